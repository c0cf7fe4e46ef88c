"""The planner-only agent, step by step: what it does when it is told what, and when it runs into things."""

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_proto import EMBEDDING_DIMENSION, PlannerFailed, SubgoalReply, Timings
from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action
from thinknav_trainer.agents import Obedience, ObedientAgent
from thinknav_trainer.agents.obedient import TURNS_AWAY
from thinknav_trainer.thoughts import Thought

STOP, FORWARD, LEFT, RIGHT, THINK = Action


def thought(subgoal: str | None, confidence: float | None = None, env: int = 0) -> Thought:
    if subgoal is None:
        return Thought(env, "chair", PlannerFailed("no idea"))
    reply = SubgoalReply(
        request_id="1",
        subgoal=subgoal,
        embedding=np.zeros(EMBEDDING_DIMENSION, np.float32),
        confidence=confidence,
        planner="mock@0",
        embedding_space="mock@0",
        timings=Timings(queued=0.0, planned=0.0, embedded=0.0),
    )
    return Thought(env, "chair", reply)


class Drive:
    """One agent in a world of which it feels its place alone."""

    def __init__(self, agent: ObedientAgent) -> None:
        self.agent = agent
        self.gps = np.zeros((1, 2), np.float32)

    def act(self, *said: Thought) -> Action:
        observations: Observations = {"gps": self.gps.copy()}
        (action,) = self.agent.actions(observations, said)
        return Action(action)

    def told(self, subgoal: str | None, confidence: float | None = None) -> Action:
        """It thinks, is told this, and does what?"""
        assert self.act() == THINK
        return self.act(thought(subgoal, confidence))

    def walks(self) -> None:
        """The step forward was free."""
        self.gps += 0.25


@pytest.fixture
def drive() -> Drive:
    return Drive(ObedientAgent(1))


@pytest.mark.parametrize(
    ("subgoal", "action"),
    [
        ("turn left to the door", LEFT),
        ("turn right", RIGHT),
        ("move forward", FORWARD),
        ("look at the lamp", FORWARD),
        (None, FORWARD),
    ],
)
def test_it_does_what_it_is_told_and_thinks_again(drive: Drive, subgoal: str | None, action: Action) -> None:
    assert drive.told(subgoal) == action
    drive.walks()
    assert drive.act() == THINK


def test_one_word_may_stand_for_several_steps() -> None:
    drive = Drive(ObedientAgent(1, Obedience(turns=3, forwards=2)))
    assert [drive.told("turn right"), drive.act(), drive.act(), drive.act()] == [RIGHT, RIGHT, RIGHT, THINK]
    assert drive.act(thought("move forward", env=0)) == FORWARD
    drive.walks()
    assert drive.act() == FORWARD
    drive.walks()
    assert drive.act() == THINK


def test_stop_takes_a_second_look_from_another_side(drive: Drive) -> None:
    assert drive.told("stop, it is right ahead", 0.9) == LEFT
    assert drive.told("stop", 0.85) == STOP


def test_a_stop_that_is_not_confirmed_is_forgotten_and_looked_at_from_the_other_side(drive: Drive) -> None:
    assert drive.told("stop", 0.9) == LEFT
    assert drive.told("turn left") == LEFT
    assert drive.told("stop", 0.9) == RIGHT  # the first of two again
    assert drive.told("stop", 0.5) == FORWARD  # too unsure to confirm anything
    drive.walks()
    assert drive.told("stop", 0.9) == LEFT


def test_a_stop_below_the_gate_leads_forward(drive: Drive) -> None:
    assert drive.told("stop", 0.79) == FORWARD


def test_a_planner_without_confidence_is_believed(drive: Drive) -> None:
    assert drive.told("stop") == LEFT
    assert drive.told("stop") == STOP


def test_one_look_stops_at_once_and_three_look_to_both_sides() -> None:
    assert Drive(ObedientAgent(1, Obedience(looks=1))).told("stop", 0.8) == STOP
    drive = Drive(ObedientAgent(1, Obedience(looks=3)))
    assert [drive.told("stop", 1.0) for _ in range(3)] == [LEFT, RIGHT, STOP]


def test_bumping_turns_it_away_to_the_same_side_until_a_step_is_free(drive: Drive) -> None:
    assert drive.told("move forward") == FORWARD
    sides = set()
    for _ in range(4):
        turns = [drive.act() for _ in range(TURNS_AWAY)]
        sides |= set(turns)
        assert drive.act() == FORWARD
    assert sides in ({LEFT}, {RIGHT})
    drive.walks()
    assert drive.act() == THINK


def test_it_turns_away_to_either_side(drive: Drive) -> None:
    sides = []
    for _ in range(30):
        drive.told("move forward")
        turns = [drive.act() for _ in range(TURNS_AWAY)]
        sides.append(turns[0])
        drive.act()
        drive.walks()
    assert set(sides) == {LEFT, RIGHT}


def test_a_bump_ends_what_it_was_about_to_do() -> None:
    drive = Drive(ObedientAgent(1, Obedience(forwards=4)))
    assert drive.told("move forward") == FORWARD
    for _ in range(TURNS_AWAY):
        assert drive.act() in (LEFT, RIGHT)
    assert drive.act() == FORWARD
    drive.walks()
    assert drive.act() == THINK


def test_turning_on_the_spot_is_no_bump(drive: Drive) -> None:
    for _ in range(5):
        assert drive.told("turn left") == LEFT


def test_told_to_turn_back_it_goes_between(drive: Drive) -> None:
    assert [drive.told("turn left"), drive.told("turn right")] == [LEFT, FORWARD]
    drive.walks()
    assert drive.told("turn right") == RIGHT  # since a step forward, nothing has been turned to
    drive = Drive(ObedientAgent(1, Obedience(turns=3, forwards=2)))
    assert [drive.told("turn right"), drive.act(), drive.act()] == [RIGHT] * 3
    assert [drive.told("turn left"), drive.act()] == [LEFT, FORWARD]
    drive.walks()
    assert drive.act() == FORWARD


def test_having_turned_all_around_it_goes_on() -> None:
    drive = Drive(ObedientAgent(1, Obedience(turns=4)))
    for _ in range(9):
        assert drive.told("turn left") == LEFT
        assert [drive.act() for _ in range(3)] == [LEFT] * 3
    assert drive.told("turn left") == FORWARD


def test_each_env_has_its_own_episode() -> None:
    agent = ObedientAgent(2, Obedience(turns=2))
    observations: Observations = {"gps": np.zeros((2, 2), np.float32)}

    def act(*said: Thought) -> list[int]:
        actions: NDArray[np.int64] = agent.actions(observations, said)
        return list(actions)

    assert act() == [THINK, THINK]
    assert act(thought("turn left", env=0), thought("turn right", env=1)) == [LEFT, RIGHT]
    agent.ended(np.array([True, False]))
    assert act() == [THINK, RIGHT]
    agent.ended(np.array([False, False]))
    assert act(thought("stop", env=0)) == [LEFT, THINK]


def test_manners_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 and stop_gate within 0 to 1"):
        Obedience(turns=0)
    with pytest.raises(ValueError, match="stop_gate within 0 to 1"):
        Obedience(stop_gate=1.5)
