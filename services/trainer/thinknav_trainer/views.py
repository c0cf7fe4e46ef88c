"""Which of the views that an agent has had are worth showing to a planner beside the present one.

One frame holds too little of a home. An agent that turns by ten degrees sees nearly the same again,
so a view is kept only where it looks elsewhere or was seen from elsewhere than all that are kept. Knows poses; what a
view is made of (a frame, the number of a frame) is up to the caller.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation.kinematics import wrap

T = TypeVar("T")

# Views that differ by less than both of these are the same. Answers to views 30 degrees apart are nearly independent.
TURNED_RAD = math.radians(29.0)  # three turns of ten degrees, whatever their rounding
MOVED_M = 0.99


@dataclass(frozen=True)
class KeptView(Generic[T]):
    """A view and the pose (4,) it was seen from."""

    view: T
    pose: NDArray[np.float64]


class RecentViews(Generic[T]):
    """The last `count` distinct views of one agent in one episode."""

    def __init__(self, count: int) -> None:
        # One more than are shown, since the present view may be among them.
        self._kept: deque[KeptView[T]] = deque(maxlen=count + 1)
        self._count = count

    def is_new(self, pose: NDArray[np.float64]) -> bool:
        """Whether `see` would keep a view from here: so that a caller draws no picture in vain."""
        return self._count > 0 and all(differ(pose, kept.pose) for kept in self._kept)

    def see(self, pose: NDArray[np.float64], view: T) -> None:
        """Keep a view from a pose (4,), if it is new."""
        if self.is_new(pose):
            self._kept.append(KeptView(view, np.array(pose)))

    def before(self, pose: NDArray[np.float64]) -> list[tuple[T, float]]:
        """The views other than that from `pose`, oldest first, each with its heading relative to it, left positive."""
        others = [kept for kept in self._kept if differ(pose, kept.pose)]
        return [(kept.view, float(wrap(kept.pose[3] - pose[3]))) for kept in others[-self._count :]]

    @property
    def kept(self) -> list[KeptView[T]]:
        """All that are kept, oldest first; one of them may be the present view."""
        return list(self._kept)

    def forget(self) -> None:
        """An episode has ended."""
        self._kept.clear()


def differ(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether two poses (4,) show different views."""
    turned = abs(float(wrap(one[3] - other[3])))
    return turned > TURNED_RAD or math.hypot(one[0] - other[0], one[2] - other[2]) > MOVED_M
