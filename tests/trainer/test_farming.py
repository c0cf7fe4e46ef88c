"""Signs of farming, on trajectories written by hand, on any trajectory, and on real episodes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_sim.task_config import Action
from thinknav_trainer.agents import AGENTS
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.evaluate import Conditions, play
from thinknav_trainer.farming import FARMING, LONGEST_LOOP, agreement_share, farming_measures, spinning, think_loops
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.scenes import Homes
from thinknav_trainer.trajectories import Trajectories, Trajectory

ACTIONS = {
    "t": Action.THINK,
    "l": Action.TURN_LEFT,
    "r": Action.TURN_RIGHT,
    "f": Action.MOVE_FORWARD,
    "b": Action.MOVE_FORWARD,  # blocked
    "s": Action.STOP,
}


def walk(steps: str, x: float = 0.0, z: float = 0.0, turned: int = 0) -> Trajectory:
    """A letter a step; a capital one does what it was told, one after a minus something else."""
    rows, agreement = [], 0
    for letter in steps.replace(" ", ""):
        if letter == "-":
            agreement = -1
            continue
        heading = math.radians(10 * turned)
        rows.append(((x, z), heading, ACTIONS[letter.lower()], 1 if letter.isupper() else agreement))
        agreement = 0
        turned += {"l": 1, "r": -1}.get(letter.lower(), 0)
        if letter.lower() == "f":
            x, z = x - 0.25 * math.sin(heading), z - 0.25 * math.cos(heading)
    places, headings, actions, agreements = zip(*rows, strict=True)
    return Trajectory(np.array(places), np.array(headings), np.array(actions), np.array(agreements))


@pytest.mark.parametrize(
    ("steps", "loops"),
    [
        ("tLr tLr tLr s", 1.0),  # think, agree, undo
        ("tL tR tL tR s", 1.0),  # think, agree, think, agree
        ("tB tB tB s", 1.0),  # obediently against a wall
        ("tL" * 36 + "s", 1.0),  # all around
        ("tF tF tL tF s", 0.0),  # obeyed all the way
        ("t-l r t-l r s", 0.0),  # back and forth, but not as it was told
        ("lrlrlrlr s", 0.0),  # nor where nothing was asked
        ("tLlllll rrrrrr s", 0.0),  # one obeyed think on a long way back: looked around rather than farmed
        ("ff tLr ff s", 3 / 7),
        ("r tL f r tL f s", 0.0),  # an error, and told of it, put right
        ("tr tL f tr tL f s", 0.0),
        ("tL r tL r f s", 6 / 7),  # what was told, and undone
    ],
)
def test_think_agree_loops(steps: str, loops: float) -> None:
    trajectory = walk(steps)
    count = len(trajectory)
    assert think_loops(trajectory) == pytest.approx(loops * (count - 1) / count)  # the stop belongs to none


@pytest.mark.parametrize(
    ("steps", "share"),
    [
        ("lr lr lr s", 1.0),
        ("l" * 36 + "s", 1.0),  # all around
        ("lllll ff rrrrr ff s", 0.0),  # around a corner and back
        ("lf rf lf rf s", 0.0),  # slalom
        ("llr ff s", 2 / 3),
        ("l b t b r s", 1.0),  # at a wall
        ("ff s", 0.0),
    ],
)
def test_spinning(steps: str, share: float) -> None:
    assert spinning(walk(steps)) == pytest.approx(share)


def test_a_farmer_scores_high_and_who_goes_straight_nothing() -> None:
    farmer = farming_measures(walk("tLr" * 166 + "tL"), {"agreement": 16.7, "progress": 0.3})
    assert farmer["think_loops"] > 0.99
    assert farmer["spinning"] > 0.99
    assert farmer["agreement_share"] == pytest.approx(16.7 / 17)
    assert (farmer["agreed"], farmer["disagreed"]) == (167, 0)
    straight = farming_measures(walk("lll tF fff rr tF ff -r f s"), {"progress": 4.0, "success": 2.5})
    assert straight == {"think_loops": 0, "spinning": 0, "agreement_share": 0, "agreed": 2, "disagreed": 1}


def test_agreement_is_set_against_what_else_was_earned() -> None:
    assert agreement_share({"agreement": 1.0, "progress": 2.0, "success": 0.0, "slack": -0.5}) == pytest.approx(1 / 3)
    assert agreement_share({"agreement": -1.0, "progress": 2.0}) == 0
    assert agreement_share({"agreement": 0.5, "progress": -2.0}) == 1
    assert agreement_share({"slack": -0.5}) == 0


moves = st.text(st.sampled_from("tlrfbLRFB"), min_size=1, max_size=120)


@settings(deadline=None, max_examples=60)
@given(moves, st.floats(-50, 50), st.floats(-50, 50), st.integers(-40, 40))
def test_where_an_episode_takes_place_does_not_matter(steps: str, x: float, z: float, turned: int) -> None:
    here, there = walk(steps), walk(steps, x, z, turned)
    assert think_loops(here) == think_loops(there)
    assert spinning(here) == spinning(there)
    assert 0 <= think_loops(here) <= 1
    assert 0 <= spinning(here) <= 1


@settings(deadline=None, max_examples=60)
@given(moves)
def test_without_agreement_nothing_is_farmed(steps: str) -> None:
    assert think_loops(walk(steps.lower())) == 0


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 17), st.sampled_from("lrLR"), st.integers(1, 9)), max_size=12))
def test_who_steps_forward_between_turns_of_one_side_spins_and_farms_nothing(legs: list[tuple[int, str, int]]) -> None:
    """Never back to the same place and heading: each leg turns once to one side, by less than half a turn, and walks;
    all of them together turn by less than a circle."""
    steps, turned = "f", 0
    for turns, side, forwards in legs:
        if turned + turns < 36:
            steps += "l" * max(0, turns - 1) + ("tL" if side.isupper() else "l") * min(1, turns) + "f" * forwards
            turned += turns
    trajectory = walk(steps)
    assert spinning(trajectory) == 0
    assert think_loops(trajectory) == 0


@settings(deadline=None, max_examples=40)
@given(moves, moves, st.integers(1, 30))
def test_a_loop_in_between_is_found(before: str, after: str, times: int) -> None:
    trajectory = walk(before + "tLr" * times + after)
    assert think_loops(trajectory) * len(trajectory) >= 3 * times - 1e-9


def test_longer_ways_back_are_none() -> None:
    whole_circle = "tL" * 36
    assert len(whole_circle) == LONGEST_LOOP
    assert think_loops(walk(whole_circle + "s")) > 0.9
    assert think_loops(walk("t" + whole_circle + "s")) > 0.9  # the shorter one in it
    assert think_loops(walk("tL" + "ttL" * 35 + "s")) == 0


# Real episodes


def test_what_an_env_notes_is_what_happened(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(lambda request: "turn left", reward="paper", max_steps=60)
    env.reset()
    for action in [Action.THINK, Action.TURN_LEFT, Action.TURN_RIGHT] * 5:
        env.step(np.array([action, Action.TURN_RIGHT]))
    farmer, other = env.step(np.array([Action.STOP, Action.STOP])).ended
    assert farmer.measures["think_loops"] == pytest.approx(15 / 16)
    assert farmer.measures["spinning"] == 1
    assert (farmer.measures["agreed"], farmer.measures["disagreed"]) == (5, 0)
    assert farmer.measures["agreement_share"] == 1
    assert other.measures["think_loops"] == other.measures["spinning"] == 0
    env.step(np.array([Action.TURN_LEFT, Action.TURN_LEFT]))
    again = env.step(np.array([Action.STOP, Action.STOP])).ended[0]
    assert [again.measures[name] for name in FARMING] == [0.0] * 5


def test_the_shortest_path_farms_nothing(smoke: TrainConfig, homes: Homes) -> None:
    task = smoke.env.model_copy(update={"max_steps": 200})
    think = smoke.think.model_copy(update={"strategy": "never"})
    conditions = Conditions(task, think, num_envs=4)
    records = play(AGENTS["shortest-path"].make, conditions, homes.scenes, homes.train[:12], None, Interruption())
    assert {record.measures[name] for record in records for name in FARMING} == {0.0}


def test_trajectories_of_several_agents_go_on_from_a_state() -> None:
    poses = np.array([[1.0, 0.0, 2.0, 0.5], [3.0, 0.0, 4.0, -0.5]])
    one, other = Trajectories(2), Trajectories(2)
    for agents in ([0, 1], [1], [0]):
        rows = np.array(agents)
        one.note(rows, poses[rows], np.array([Action.THINK] * len(rows)), np.array([-1] * len(rows), np.int8))
    other.load_state_dict(one.state_dict())
    one.forget([1])
    assert (len(one.of(0)), len(one.of(1)), len(other.of(1))) == (2, 0, 2)
    np.testing.assert_array_equal(other.of(1).places, [[3, 4], [3, 4]])
    np.testing.assert_array_equal(other.of(0).headings, one.of(0).headings)
    np.testing.assert_array_equal(other.of(0).agreements, [-1, -1])
