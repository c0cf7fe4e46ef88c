"""Signs that a bonus is farmed rather than earned, told from what was done in an episode; docs/metrics.md defines them.

Knows trajectories and sums of reward terms; nothing of schemes and of planners.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.task_config import Action
from thinknav_trainer.trajectories import Trajectory

# The longest way back to where it began that counts: a full circle of turns of 10 degrees, with a think before each.
LONGEST_LOOP = 72
# The share of a loop's steps that did what a subgoal had just said: with undoing it is a third, without it a half.
OBEYED_SHARE = 0.25
# Two places and two headings that are the same: contact leaves up to 1 cm to walk, and a turn is 10 degrees.
SAME_PLACE_M = 0.05
SAME_HEADING = np.radians(1.0)

FARMING = ("think_loops", "spinning", "agreement_share", "agreed", "disagreed")

_Mask = NDArray[np.bool_]


def farming_measures(trajectory: Trajectory, terms: Mapping[str, float]) -> dict[str, float]:
    """All of FARMING. terms: the sum of each reward term over the episode."""
    return {
        "think_loops": think_loops(trajectory),
        "spinning": spinning(trajectory),
        "agreement_share": agreement_share(terms),
        "agreed": float((trajectory.agreements > 0).sum()),
        "disagreed": float((trajectory.agreements < 0).sum()),
    }


def think_loops(trajectory: Trajectory) -> float:
    """Share of steps in think-agree loops: subgoals were obeyed, and it led back to where the first one was obeyed."""
    obeyed = _sum_before(trajectory.agreements > 0)
    begins = _obeys_next(trajectory)
    places = trajectory.places @ np.array([1, 1j])
    same_heading = _heading_comparer(trajectory)

    def is_loop(lag: int) -> _Mask:
        often = obeyed[lag:] - obeyed[:-lag] >= OBEYED_SHARE * lag
        loop: _Mask = begins[:-lag] & often & (np.abs(places[lag:] - places[:-lag]) <= SAME_PLACE_M)
        return loop & same_heading(lag)

    return _share(_steps_of(len(trajectory), is_loop))


def spinning(trajectory: Trajectory) -> float:
    """Share of turns that were taken back, or closed a circle, before the agent had left its place; 0 without turns."""
    walked = np.linalg.norm(np.diff(trajectory.places, axis=0, append=trajectory.places[-1:]), axis=1)
    way = _sum_before(walked)
    same_heading = _heading_comparer(trajectory)

    def is_spin(lag: int) -> _Mask:
        stayed: _Mask = way[lag:] - way[:-lag] <= SAME_PLACE_M
        return stayed & same_heading(lag)

    turns = np.isin(trajectory.actions, (Action.TURN_LEFT, Action.TURN_RIGHT))
    return _share(_steps_of(len(trajectory), is_spin)[turns])


def agreement_share(terms: Mapping[str, float]) -> float:
    """Of what agreement, progress and success brought, where each brought something: the share of agreement."""
    earned = {name: max(0.0, terms.get(name, 0.0)) for name in ("agreement", "progress", "success")}
    total = sum(earned.values())
    return earned["agreement"] / total if total else 0.0


def _steps_of(count: int, closes: Callable[[int], _Mask]) -> _Mask:
    """Which of `count` steps belong to a stretch that closes.

    closes: for a length, (count - length,) whether the stretch of it that begins with each step does. It ends where
    another step begins, since nobody noted where the last one led.
    """
    changes = np.zeros(count + 1, np.int64)
    for length in range(1, min(LONGEST_LOOP, count - 1) + 1):
        closed = closes(length)
        changes[: count - length] += closed
        changes[length:count] -= closed
    return np.cumsum(changes[:-1]) > 0


def _obeys_next(trajectory: Trajectory) -> _Mask:
    """(T,) whether the next action that is no think, this one or a later one, did what it was told."""
    moves = trajectory.actions != Action.THINK
    obeyed = trajectory.agreements > 0
    following = np.minimum.accumulate(np.where(moves, np.arange(len(moves)), len(moves))[::-1])[::-1]
    return np.append(obeyed, False)[following]


def _heading_comparer(trajectory: Trajectory) -> Callable[[int], _Mask]:
    """For a length: (T - length,) whether the agent looks the same way again after so many steps."""
    x, z = np.sin(trajectory.headings), np.cos(trajectory.headings)
    return lambda lag: x[lag:] * x[:-lag] + z[lag:] * z[:-lag] >= np.cos(SAME_HEADING)


def _sum_before(values: NDArray[np.generic]) -> NDArray[np.float64]:
    """(T,) the sum of all values (T,) before each."""
    return np.concatenate([[0.0], np.cumsum(values, dtype=np.float64)[:-1]])


def _share(mask: _Mask) -> float:
    return float(mask.mean()) if len(mask) else 0.0
