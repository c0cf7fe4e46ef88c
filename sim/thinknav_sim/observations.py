"""What an agent senses, and the spaces of it: rgb, depth, gps, compass and the goal as Habitat-Lab has them, and how
far the last step led.
"""

import math
from typing import Any

import numpy as np
from gymnasium import spaces
from numba import njit
from numpy.typing import NDArray

from thinknav_sim.navigation.kinematics import wrap
from thinknav_sim.scene import GOAL_CATEGORIES, MAX_EXTENT_M
from thinknav_sim.task_config import ObjectNavConfig

# The observations of N agents by name:
# rgb: (N, H, W, 3) uint8.
# depth: (N, H, W, 1) float32, 0 at min_depth and nearer or where there is nothing, 1 at max_depth and farther.
# gps: (N, 2) float32, metres forward and to the right of the start, as the agent faced it ([-z, x] of that frame).
# compass: (N, 1) float32, radians turned since the start, left positive.
# moved: (N, 1) float32, metres walked in the last step, as odometry tells: less than a step where something blocked.
# objectgoal: (N, 1) int64, index into GOAL_CATEGORIES.
Observations = dict[str, NDArray[Any]]


def observation_space(config: ObjectNavConfig) -> spaces.Dict:
    """The space of one agent's observation."""
    size = (config.height, config.width)
    return spaces.Dict(
        {
            "rgb": spaces.Box(0, 255, (*size, 3), np.uint8),
            "depth": spaces.Box(0.0, 1.0, (*size, 1), np.float32),
            "gps": spaces.Box(-MAX_EXTENT_M, MAX_EXTENT_M, (2,), np.float32),
            "compass": spaces.Box(-math.pi, math.pi, (1,), np.float32),
            "moved": spaces.Box(0.0, MAX_EXTENT_M, (1,), np.float32),
            "objectgoal": spaces.Box(0, len(GOAL_CATEGORIES) - 1, (1,), np.int64),
        }
    )


@njit(cache=True)
def gps(poses: NDArray[np.float64], starts: NDArray[np.float64]) -> NDArray[np.float32]:
    """Displacement in the start frame: (N, 2) [-z, x] from poses and starts, both (N, 4)."""
    local = np.empty((len(poses), 2), np.float32)
    for row in range(len(poses)):
        dx, dz = poses[row, 0] - starts[row, 0], poses[row, 2] - starts[row, 2]
        sine, cosine = math.sin(starts[row, 3]), math.cos(starts[row, 3])
        local[row, 0] = -sine * dx - cosine * dz
        local[row, 1] = cosine * dx - sine * dz
    return local


@njit(cache=True)
def compass(poses: NDArray[np.float64], starts: NDArray[np.float64]) -> NDArray[np.float32]:
    """Heading since the start: (N, 1) radians from poses and starts, both (N, 4)."""
    turned = np.empty((len(poses), 1), np.float32)
    for row in range(len(poses)):
        turned[row, 0] = wrap(poses[row, 3] - starts[row, 3])
    return turned
