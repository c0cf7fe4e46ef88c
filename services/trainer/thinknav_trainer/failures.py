"""Why an episode failed, told from what was done and seen in it. Six causes, one for each failure; docs/evaluation.md.

Knows arrays; where they come from is `witness`'s concern.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.task_config import Action
from thinknav_trainer.free_heading import BLOCKED_M

# An agent is stuck that stayed this near to where it ended, for this many steps, and ran into something meanwhile.
STUCK_STEPS = 100
STUCK_M = 0.5
# Who ends this much farther from the goal than it has been since it first saw it has left it.
LEFT_M = 1.0


class Cause(StrEnum):
    """Why an episode failed."""

    STOPPED_TOO_FAR = "stopped_too_far"
    STOPPED_NOT_FACING = "stopped_not_facing"
    STUCK = "stuck"
    NEVER_SAW = "never_saw_the_goal"
    SAW_AND_LEFT = "saw_it_and_left"
    OUT_OF_STEPS = "out_of_steps"


@dataclass(frozen=True)
class Trace:
    """A failed episode of T steps.

    poses: (T, 4), before each step. actions: (T,). distances: (T,) metres to the goal, at the poses.
    seen: (T,) bool, the goal was in view. near: it ended in the goal's success zone.
    """

    poses: NDArray[np.float64]
    actions: NDArray[np.int64]
    distances: NDArray[np.float64]
    seen: NDArray[np.bool_]
    near: bool


def failure_cause(trace: Trace) -> Cause:
    """The cause of a failure. How it ended comes first: a stop in the wrong place, then what kept it from stopping."""
    if trace.actions[-1] == Action.STOP:
        return Cause.STOPPED_NOT_FACING if trace.near else Cause.STOPPED_TOO_FAR
    if is_stuck(trace):
        return Cause.STUCK
    if not trace.seen.any():
        return Cause.NEVER_SAW
    since = trace.distances[int(trace.seen.argmax()) :]
    left = not trace.seen[-1] and since[-1] >= since.min() + LEFT_M
    return Cause.SAW_AND_LEFT if left else Cause.OUT_OF_STEPS


def is_stuck(trace: Trace) -> bool:
    """Whether the last STUCK_STEPS were spent in one place, before something that blocked."""
    if len(trace.actions) < STUCK_STEPS:
        return False
    places = trace.poses[-STUCK_STEPS:, [0, 2]]
    if np.linalg.norm(places - places[-1], axis=1).max() > STUCK_M:
        return False
    walked = np.linalg.norm(np.diff(places, axis=0), axis=1)
    forward = trace.actions[-STUCK_STEPS:-1] == Action.MOVE_FORWARD
    return bool((walked[forward] < BLOCKED_M).any())
