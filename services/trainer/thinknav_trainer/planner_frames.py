"""The pictures that N agents show a planner: what they see now, in the size that `think.frame_size` names.

Agents who see pictures of that size anyway have them remembered: nothing is drawn twice. Knows nothing of requests.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.vector_env import ObjectNavVectorEnv


class PlannerFrames:
    """Tell it what agents observe, and it draws the rest."""

    def __init__(self, env: ObjectNavVectorEnv, size: int) -> None:
        self._env = env
        self._size = size
        self._seen = np.empty((env.num_envs, size, size, 3), np.uint8)
        self._known = np.zeros(env.num_envs, np.bool_)

    def observe(self, agents: NDArray[np.integer[Any]], rgb: NDArray[np.uint8]) -> None:
        """What some agents (n,) see now: (n, height, width, 3)."""
        if rgb.shape[1:] == self._seen.shape[1:]:
            self._seen[agents] = rgb
            self._known[agents] = True

    def of(self, agents: NDArray[np.integer[Any]]) -> NDArray[np.uint8]:
        """What some agents (n,) see now: (n, size, size, 3)."""
        if self._known[agents].all():
            return np.take(self._seen, agents, axis=0)
        return self._env.frames(agents, self._size, self._size)

    def forget(self) -> None:
        """Agents are elsewhere now."""
        self._known[:] = False
