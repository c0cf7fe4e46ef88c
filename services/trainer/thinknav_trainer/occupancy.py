"""What one agent has seen of the floor: free, blocked, unknown. Built from its depth, gps and compass alone.

The map's frame has its origin where the episode began and its heading 0 as the agent faced then; axes, poses and cells
are those of the simulator's own grids, so that the same code plans on both. It knows nothing of goals.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render import Camera
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.obstacle_kernels import BLOCKED, FREE, UNKNOWN, mark_obstacles
from thinknav_trainer.visible import camera_rays

CELL_M = 0.05
HALF_M = 25.0  # how far the map reaches from the start; what lies beyond stays unknown
# What rises no higher above the floor is no obstacle, as in the simulator.
FLOOR_M = 0.1
_RAYS = 64  # along each side of the picture


def map_pose(gps: NDArray[np.floating], compass: float) -> NDArray[np.float64]:
    """The pose (4,) in the map's frame: gps (2,) is metres forward and to the right of the start."""
    return np.array([gps[1], 0.0, -gps[0], compass], np.float64)


def ahead_of(
    pose: NDArray[np.float64], left: NDArray[np.floating], forward: NDArray[np.floating]
) -> NDArray[np.float64]:
    """x and z (..., 2) of what lies so many metres to the left of a pose (4,) and ahead of it."""
    sine, cosine = math.sin(pose[3]), math.cos(pose[3])
    return np.stack([pose[0] - cosine * left - sine * forward, pose[2] + sine * left - cosine * forward], axis=-1)


@cache
def _offsets(reach: int) -> NDArray[np.int64]:
    """(n, 2) of all cells within so many columns and rows."""
    steps = np.arange(-reach, reach + 1)
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)


class OccupancyMap:
    """state: (rows, cols) uint8, UNKNOWN, FREE or BLOCKED; rows run along z and columns along x."""

    def __init__(self, config: ObjectNavConfig) -> None:
        side = round(2 * HALF_M / CELL_M)
        self.state = np.full((side, side), UNKNOWN, np.uint8)
        self._config = config
        camera = Camera(config.width, config.height, config.hfov, config.camera_height)
        (rows, columns), left, up = camera_rays(camera, _RAYS)
        self._rays = rows, columns, up, left
        # Of each column of rays, at depth 1; falls from left to right.
        self._left: NDArray[np.float32] = left[: min(_RAYS, config.width)]

    def cells(self, places: NDArray[np.floating]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of places (..., 2), x and z; those beyond the map are put on its rim."""
        index = np.clip(np.floor((places + HALF_M) / CELL_M), 0, len(self.state) - 1).astype(np.int64)
        return index[..., 1], index[..., 0]

    def look(self, depth: NDArray[np.float32], pose: NDArray[np.float64]) -> None:
        """Take in a picture (H, W, 1) of the depth sensor, seen from a pose (4,) in the map's frame.

        A cell is free when it is nearer than whatever is in the way of a body in the columns of the picture on both
        its sides. What blocks once blocks for good: nothing here moves.
        """
        ahead = self.look_for_obstacles(depth, pose)
        self._clear(pose, ahead.reshape(-1, len(self._left)).min(axis=0))

    def look_for_obstacles(self, depth: NDArray[np.float32], pose: NDArray[np.float64]) -> NDArray[np.float32]:
        """The same, for whoever does not ask what is free: much less work. Returns what `mark_obstacles` does."""
        config = self._config
        sensor = config.min_depth, config.max_depth
        body = config.camera_height, config.agent_height, FLOOR_M
        ahead: NDArray[np.float32] = mark_obstacles(self.state, depth, self._rays, pose, sensor, body, CELL_M, HALF_M)
        return ahead

    def bump(self, pose: NDArray[np.float64]) -> None:
        """Something that the camera does not see stands right ahead of the body."""
        ahead = np.array([self._config.agent_radius + CELL_M / 2])
        self.state[self.cells(ahead_of(pose, np.zeros(1), ahead))] = BLOCKED

    def stand(self, pose: NDArray[np.float64]) -> None:
        """The agent's body is here, so nothing else is."""
        rows, cols = self.near(pose, self._config.agent_radius)
        known = self.state[rows, cols] == BLOCKED
        self.state[rows[~known], cols[~known]] = FREE

    def near(self, pose: NDArray[np.float64], radius: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of the cells whose centres lie within a radius of a pose."""
        place = pose[[0, 2]]
        centres = (np.floor(place / CELL_M) + _offsets(math.ceil(radius / CELL_M) + 1) + 0.5) * CELL_M
        return self.cells(centres[np.linalg.norm(centres - place, axis=1) <= radius])

    def known_part(self) -> tuple[slice, slice]:
        """The part of the map that holds all that is known, and a cell around it. Something must be known."""
        known = self.state != UNKNOWN
        rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        return slice(max(rows[0] - 1, 0), rows[-1] + 2), slice(max(cols[0] - 1, 0), cols[-1] + 2)

    def _clear(self, pose: NDArray[np.float64], reach: NDArray[np.floating]) -> None:
        """Free the unknown cells that are nearer than `reach` (columns of rays,), metres ahead, says."""
        config = self._config
        half = config.max_depth * max(1.0, math.tan(math.radians(config.hfov) / 2))
        corners = np.array([[-half, 0.0], [half, 0.0], [-half, config.max_depth], [half, config.max_depth]])
        rows, cols = self.cells(ahead_of(pose, corners[:, 0], corners[:, 1]))
        window = slice(rows.min(), rows.max() + 1), slice(cols.min(), cols.max() + 1)
        x = (np.arange(window[1].start, window[1].stop) + 0.5) * CELL_M - HALF_M - pose[0]
        z = ((np.arange(window[0].start, window[0].stop) + 0.5) * CELL_M - HALF_M - pose[2])[:, None]
        sine, cosine = math.sin(pose[3]), math.cos(pose[3])
        forward = -sine * x - cosine * z
        left = -cosine * x + sine * z
        # Between which two columns of rays a cell lies; beyond the outermost it is not seen.
        column = (self._left[0] - left / np.maximum(forward, 1e-6)) / (self._left[0] - self._left[1])
        first = np.clip(np.floor(column), 0, len(reach) - 2).astype(np.int64)
        limit = np.minimum(reach[first], reach[first + 1])
        seen = (forward > 0) & (column >= 0) & (column <= len(reach) - 1) & (forward < limit)
        state = self.state[window]
        state[seen & (state == UNKNOWN)] = FREE
