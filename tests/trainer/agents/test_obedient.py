"""The planner-only agent, step by step: what it does when it is told what, and when it runs into things."""

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_proto import EMBEDDING_DIMENSION, PlannerFailed, SubgoalReply, Timings
from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_trainer.agents import Obedience, ObedientAgent
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


CONFIG = ObjectNavConfig(width=16, height=16)


def nothing_near(envs: int) -> Observations:
    """What agents sense who stand where they started in an empty world."""
    return {
        "gps": np.zeros((envs, 2), np.float32),
        "compass": np.zeros((envs, 1), np.float32),
        "depth": np.ones((envs, CONFIG.height, CONFIG.width, 1), np.float32),
    }


class Drive:
    """One agent in a world that is empty to the eye; whether a step forward is free, the test says."""

    def __init__(self, obedience: Obedience = Obedience(turns=1, forwards=1)) -> None:
        self.agent = ObedientAgent(1, CONFIG, obedience)
        self.senses = nothing_near(1)

    def act(self, *said: Thought) -> Action:
        (action,) = self.agent.actions({name: value.copy() for name, value in self.senses.items()}, said)
        if action in (LEFT, RIGHT):
            self.senses["compass"] += np.radians(10 if action == LEFT else -10).astype(np.float32)
        return Action(action)

    def told(self, subgoal: str | None, confidence: float | None = None) -> Action:
        """It thinks, is told this, and does what?"""
        assert self.act() == THINK
        return self.act(thought(subgoal, confidence))

    def walks(self) -> None:
        """The step forward was free."""
        heading = self.senses["compass"][0, 0]
        self.senses["gps"] += np.array([0.25 * np.cos(heading), -0.25 * np.sin(heading)], np.float32)


@pytest.fixture
def drive() -> Drive:
    return Drive()


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
    drive = Drive(Obedience(turns=3, forwards=2))
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
    assert Drive(Obedience(1, 1, looks=1)).told("stop", 0.8) == STOP
    drive = Drive(Obedience(1, 1, looks=3))
    assert [drive.told("stop", 1.0) for _ in range(3)] == [LEFT, RIGHT, STOP]


def test_what_it_bumps_into_it_goes_around(drive: Drive) -> None:
    assert drive.told("move forward") == FORWARD
    for _ in range(3):  # nothing ahead is to be seen, but the step was not free
        turns = []
        while (action := drive.act()) != FORWARD:
            turns.append(action)
        assert 3 <= len(turns) <= 9
        assert len(set(turns)) == 1
    drive.walks()
    assert drive.act() == THINK


def test_a_bump_ends_what_it_was_about_to_do() -> None:
    drive = Drive(Obedience(1, 4))
    assert drive.told("move forward") == FORWARD
    while drive.act() != FORWARD:
        pass
    drive.walks()
    assert drive.act() == THINK


def wall_ahead(metres: float) -> NDArray[np.float32]:
    """Depth (1, H, W, 1) of a wall across the whole picture."""
    read = (metres - CONFIG.min_depth) / (CONFIG.max_depth - CONFIG.min_depth)
    return np.full((1, CONFIG.height, CONFIG.width, 1), read, np.float32)


def test_a_wall_that_it_sees_it_does_not_walk_into(drive: Drive) -> None:
    drive.senses["depth"] = wall_ahead(0.6)
    assert drive.act() == THINK
    drive.senses["depth"] = np.ones_like(drive.senses["depth"])
    drive.senses["gps"] += np.array([0.25, 0.0], np.float32)  # so it is 35 cm away now, nearer than the sensor reads
    assert drive.act(thought("move forward")) in (LEFT, RIGHT)


def test_where_no_way_is_free_it_turns_and_asks(drive: Drive) -> None:
    actions = [drive.told("move forward")]
    while len(actions) < 200 and actions[-3:] != [LEFT, LEFT, THINK]:
        actions.append(drive.act())  # every step bumps
    assert actions[-4:] == [LEFT, LEFT, LEFT, THINK]


def test_turning_on_the_spot_is_no_bump(drive: Drive) -> None:
    for _ in range(5):
        assert drive.told("turn left") == LEFT


def test_told_to_turn_back_it_goes_between(drive: Drive) -> None:
    assert [drive.told("turn left"), drive.told("turn right")] == [LEFT, FORWARD]
    drive.walks()
    assert drive.told("turn right") == RIGHT  # since a step forward, nothing has been turned to
    drive = Drive(Obedience(turns=3, forwards=2))
    assert [drive.told("turn right"), drive.act(), drive.act()] == [RIGHT] * 3
    assert [drive.told("turn left"), drive.act()] == [LEFT, FORWARD]
    drive.walks()
    assert drive.act() == FORWARD


def test_having_turned_all_around_it_goes_on() -> None:
    drive = Drive(Obedience(turns=4))
    for _ in range(9):
        assert drive.told("turn left") == LEFT
        assert [drive.act() for _ in range(3)] == [LEFT] * 3
    assert drive.told("turn left") == FORWARD


def test_each_env_has_its_own_episode() -> None:
    agent = ObedientAgent(2, CONFIG, Obedience(turns=2))
    observations = nothing_near(2)

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
