"""Why episodes fail, on trajectories made by hand."""

from typing import Any

import numpy as np
import pytest

from thinknav_sim.task_config import Action
from thinknav_trainer.failures import STUCK_STEPS, Cause, Trace, failure_cause, is_stuck

STOP, FORWARD, LEFT, RIGHT, THINK = Action


def walk(steps: int, ending: Action = FORWARD, near: bool = False, **columns: Any) -> Trace:
    """Straight on, away from x = 0 by a quarter of a metre a step; never in view and always 3 m off, unless given."""
    poses = np.zeros((steps, 4))
    poses[:, 0] = 0.25 * np.arange(steps)
    actions = np.array([*[FORWARD] * (steps - 1), ending], np.int64)
    given: dict[str, Any] = {
        "poses": poses,
        "actions": actions,
        "distances": np.full(steps, 3.0),
        "seen": np.zeros(steps, np.bool_),
        "near": near,
    }
    return Trace(**(given | columns))


def seen_at(steps: int, *when: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    seen = np.zeros(steps, np.bool_)
    seen[list(when)] = True
    return seen


def stuck(steps: int = STUCK_STEPS, **columns: Any) -> Trace:
    """Turns and bumps in one place to the end."""
    poses = np.zeros((steps, 4))
    actions = np.array(([LEFT, FORWARD] * steps)[:steps], np.int64)
    return walk(steps, **({"poses": poses, "actions": actions} | columns))


def test_a_stop_elsewhere_is_too_far_whatever_was_seen() -> None:
    assert failure_cause(walk(5, STOP)) == Cause.STOPPED_TOO_FAR
    assert failure_cause(walk(5, STOP, seen=seen_at(5, 4))) == Cause.STOPPED_TOO_FAR


def test_a_stop_beside_it_looked_elsewhere() -> None:
    assert failure_cause(walk(5, STOP, near=True)) == Cause.STOPPED_NOT_FACING


def test_what_never_came_into_view_was_never_seen() -> None:
    assert failure_cause(walk(5)) == Cause.NEVER_SAW
    assert failure_cause(walk(5, near=True)) == Cause.NEVER_SAW


@pytest.mark.parametrize(
    ("distances", "seen", "cause"),
    [
        ([5, 4, 3, 4, 5], [1], Cause.SAW_AND_LEFT),
        ([5, 4, 3, 4, 5], [1, 4], Cause.OUT_OF_STEPS),  # still looking at it
        ([5, 4, 3, 2.5, 2], [1], Cause.OUT_OF_STEPS),  # still on the way
        ([1, 2, 3, 3.5, 3.9], [2], Cause.OUT_OF_STEPS),  # nearer before it saw it; not a metre since
        ([1, 2, 3, 3.5, 4.0], [2], Cause.SAW_AND_LEFT),
    ],
)
def test_what_was_seen_is_left_or_not_yet_reached(distances: list[float], seen: list[int], cause: Cause) -> None:
    assert failure_cause(walk(5, distances=np.array(distances), seen=seen_at(5, *seen))) == cause


def test_bumping_in_one_place_is_stuck_even_in_view() -> None:
    assert failure_cause(stuck()) == Cause.STUCK
    assert failure_cause(stuck(seen=seen_at(STUCK_STEPS, 0))) == Cause.STUCK


def test_a_stop_is_a_stop_even_after_being_stuck() -> None:
    actions = np.array([*[FORWARD] * (STUCK_STEPS - 1), STOP], np.int64)
    assert failure_cause(stuck(actions=actions)) == Cause.STOPPED_TOO_FAR


def test_who_stands_still_without_bumping_is_not_stuck() -> None:
    assert not is_stuck(stuck(actions=np.full(STUCK_STEPS, THINK)))
    assert not is_stuck(stuck(actions=np.full(STUCK_STEPS, LEFT)))


def test_it_takes_a_while_and_one_place_to_be_stuck() -> None:
    assert not is_stuck(stuck(STUCK_STEPS - 1))
    poses = np.zeros((STUCK_STEPS, 4))
    poses[0, 0] = 0.51
    assert not is_stuck(stuck(poses=poses))
    poses[0, 0] = 0.49
    assert is_stuck(stuck(poses=poses))
