"""Which way an agent can take a step, by the map that it makes of its own depth. Knows nothing of where to go."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.occupancy import BLOCKED, CELL_M, HALF_M, UNKNOWN, OccupancyMap, map_pose

# Who came no farther than this by a step forward stands before something. Contact leaves up to 1 cm to walk.
BLOCKED_M = 0.05
# Cells are read off single rays: what only touches the body's rim may be beside it.
_TOUCH_M = CELL_M / 2


class FreeHeading:
    """One agent's, of one episode."""

    def __init__(self, config: ObjectNavConfig) -> None:
        self._map = OccupancyMap(config)
        self._radius = config.agent_radius - _TOUCH_M
        self._step = config.forward_step
        self._turn = math.radians(config.turn_angle)
        half = math.floor(math.pi / self._turn + 1e-9)
        self._order = np.array([(k + 1) // 2 if k % 2 else -(k // 2) for k in range(2 * half + 1)])  # 0, 1, -1, 2, ...
        self._pose = np.zeros(4)

    def see(self, depth: NDArray[np.float32], gps: NDArray[np.floating], compass: float) -> None:
        """Take in what the sensors show: depth (H, W, 1), gps (2,)."""
        self._pose = map_pose(gps, compass)
        self._map.look_for_obstacles(depth, self._pose)

    def bump(self) -> None:
        """A step ahead was not free, whatever the sensors show."""
        self._map.bump(self._pose)

    def turns(self) -> int | None:
        """The fewest turns to a heading that is free for a step, positive to the left; None if none is."""
        reach = self._step + self._radius + 2 * CELL_M
        rows, cols = self._map.near(self._pose, reach)
        blocked = self._map.state[rows, cols] == BLOCKED
        x = (cols[blocked] + 0.5) * CELL_M - HALF_M - self._pose[0]
        z = (rows[blocked] + 0.5) * CELL_M - HALF_M - self._pose[2]
        # Straight on is the usual answer, and little work by itself.
        for order in (self._order[:1], self._order[1:]):
            heading = self._pose[3] + order[:, None] * self._turn
            forward = -np.sin(heading) * x - np.cos(heading) * z
            left = -np.cos(heading) * x + np.sin(heading) * z
            # What the body would meet and does not touch already: a capsule as long as a step, its own half left out.
            met = (forward > 0) & (np.hypot(forward - np.clip(forward, 0.0, self._step), left) < self._radius)
            free = np.flatnonzero(~met.any(axis=1))
            if len(free):
                return int(order[free[0]])
        return None

    def state_dict(self) -> dict[str, Any]:
        """All that `turns` depends on."""
        return {"blocked": np.flatnonzero(self._map.state == BLOCKED).astype(np.int32), "pose": self._pose.copy()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Stand and remember as `state_dict` was taken."""
        self._map.state[...] = UNKNOWN
        self._map.state.flat[state["blocked"]] = BLOCKED
        self._pose = state["pose"].copy()
