"""Whether one can still walk in a room: a grid over its floor, and which of its cells hang together."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from thinknav_sim.homes.doors import Rect
from thinknav_sim.homes.mesh import Floats

# Free cells keep this distance from everything. It exceeds the agent's radius (0.18 m) by more than half a cell's
# diagonal, so that finer grids agree.
BODY_M = 0.26
_CELL_M = 0.1
_REACH_M = 0.6  # a goal has walkable floor within this distance


class WalkGrid:
    """The cells of a room's floor that a body can stand in. Its middle is over a cell's centre."""

    def __init__(self, interior: Rect, entries: Sequence[tuple[float, float]]) -> None:
        """interior: x0, z0, x1, z1. entries: x and z of the places where one comes in, metres."""
        x0, z0, x1, z1 = interior
        self._x: Floats = np.arange(x0 + BODY_M, x1 - BODY_M + 1e-9, _CELL_M)
        self._z: Floats = np.arange(z0 + BODY_M, z1 - BODY_M + 1e-9, _CELL_M)
        self._free: NDArray[np.bool_] = np.ones((len(self._x), len(self._z)), dtype=bool)
        self._entries = [(int(np.abs(self._x - x).argmin()), int(np.abs(self._z - z).argmin())) for x, z in entries]
        self._goals: list[Rect] = []

    def accept(self, footprints: Sequence[Rect], goals: Sequence[Rect]) -> bool:
        """Take these footprints if one can still walk everywhere that matters; says whether they were taken."""
        free = self._free.copy()
        for rect in footprints:
            free[self._window(rect, BODY_M)] = False
        reachable = self._reachable(free)
        if reachable is None:
            return False
        if not all(reachable[self._window(rect, _REACH_M)].any() for rect in (*self._goals, *goals)):
            return False
        self._free = free
        self._goals += goals
        return True

    def _window(self, rect: Rect, margin: float) -> tuple[slice, slice]:
        """The cells whose centres lie within `margin` of the rectangle."""
        x = np.searchsorted(self._x, (rect[0] - margin + 1e-9, rect[2] + margin - 1e-9))
        z = np.searchsorted(self._z, (rect[1] - margin + 1e-9, rect[3] + margin - 1e-9))
        return slice(int(x[0]), int(x[1])), slice(int(z[0]), int(z[1]))

    def _reachable(self, free: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
        """The cells that the doorways share, None if one is cut off; without doorways, the largest region."""
        labels, count = ndimage.label(free)
        if not count:
            return None
        found = {int(labels[entry]) for entry in self._entries}
        if not found:
            found = {int(np.bincount(labels.ravel())[1:].argmax()) + 1}
        if len(found) > 1 or 0 in found:
            return None
        reachable: NDArray[np.bool_] = labels == found.pop()
        return reachable
