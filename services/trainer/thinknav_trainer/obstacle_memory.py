"""A sensor that remembers: which way an agent can walk, by what its depth has shown it and by what it ran into.

What stands beside a body is out of its camera's sight, and a network does not soon learn to remember it.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_trainer.free_heading import BLOCKED_M, FreeHeading

FREE_SIZE = 3  # cosine and sine of the turn to take, positive to the left, and 1; zeros where no way is free


class ObstacleMemory:
    """That of N agents, each of its episode so far."""

    def __init__(self, count: int, config: ObjectNavConfig) -> None:
        self._config = config
        self._headings = [FreeHeading(config) for _ in range(count)]

    def reset(self, observations: Observations) -> None:
        """All begin episodes, and observe this (N, ...): see `show`."""
        self._headings = [FreeHeading(self._config) for _ in self._headings]
        everyone = range(len(self._headings))
        observations["free"] = np.array([self._look(env, _row(observations, env), bumped=False) for env in everyone])

    def show(
        self,
        envs: NDArray[np.integer[Any]],
        actions: NDArray[np.int64],
        observations: Observations,
        final: Mapping[int, Observations],
    ) -> None:
        """Add the sensor `free`, (n, 3) float32, to what these envs (n,) observe after their actions (n,).

        final: row -> last observation of an episode that ended, which gets its own; the next one begins with an empty
        memory.
        """
        free = np.zeros((len(envs), FREE_SIZE), np.float32)
        for row, (env, action) in enumerate(zip(envs.tolist(), actions.tolist(), strict=True)):
            last = final.get(row)
            own = _row(observations, row) if last is None else last
            free[row] = self._look(env, own, action == Action.MOVE_FORWARD and own["moved"][0] < BLOCKED_M)
            if last is not None:
                last["free"] = free[row].copy()
                self._headings[env] = FreeHeading(self._config)
                free[row] = self._look(env, _row(observations, row), bumped=False)
        observations["free"] = free

    def _look(self, env: int, observation: Observations, bumped: bool) -> NDArray[np.float32]:
        heading = self._headings[env]
        heading.see(observation["depth"], observation["gps"], float(observation["compass"][0]))
        if bumped:
            heading.bump()
        turns = heading.turns()
        if turns is None:
            return np.zeros(FREE_SIZE, np.float32)
        angle = turns * math.radians(self._config.turn_angle)
        return np.array([math.cos(angle), math.sin(angle), 1.0], np.float32)

    def state_dict(self) -> list[dict[str, Any]]:
        """What each agent remembers."""
        return [heading.state_dict() for heading in self._headings]

    def load_state_dict(self, state: list[dict[str, Any]]) -> None:
        """Remember what `state_dict` gave."""
        for heading, own in zip(self._headings, state, strict=True):
            heading.load_state_dict(own)


def _row(observations: Observations, row: int) -> Observations:
    return {name: observations[name][row] for name in ("depth", "gps", "compass", "moved")}
