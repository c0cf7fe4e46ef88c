"""Which way an agent can take a step, by the map that it makes of its own depth. Knows nothing of where to go."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.obstacle_kernels import BLOCKED, NOWHERE, UNKNOWN, fewest_turns
from thinknav_trainer.occupancy import CELL_M, HALF_M, OccupancyMap, map_pose

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
        turns = fewest_turns(self._map.state, self._pose, self._turn, self._step, self._radius, CELL_M, HALF_M)
        return None if turns == NOWHERE else int(turns)

    def state_dict(self) -> dict[str, Any]:
        """All that `turns` depends on."""
        return {"blocked": np.flatnonzero(self._map.state == BLOCKED).astype(np.int32), "pose": self._pose.copy()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Stand and remember as `state_dict` was taken."""
        self._map.state[...] = UNKNOWN
        self._map.state.flat[state["blocked"]] = BLOCKED
        self._pose = state["pose"].copy()
