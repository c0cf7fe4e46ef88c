"""The state of N agents in arrays, all that tells one moment of a vector environment from another."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass
class AgentStates:
    """What N agents are doing.

    poses: (N, 4) float64. episodes: (N,) int64, index of the episode that each plays. draws: (N,) int64, episodes
    started. Of the episode so far, each (N,): steps, thinks and collisions int64; path_length float64, metres; moved
    float64, metres of the last step; distance float64, distance to the goal now, and shortest, the one at the start.
    """

    poses: NDArray[np.float64]
    episodes: NDArray[np.int64]
    draws: NDArray[np.int64]
    steps: NDArray[np.int64]
    thinks: NDArray[np.int64]
    collisions: NDArray[np.int64]
    path_length: NDArray[np.float64]
    moved: NDArray[np.float64]
    distance: NDArray[np.float64]
    shortest: NDArray[np.float64]

    @classmethod
    def zeros(cls, count: int) -> "AgentStates":
        """The states of agents that have not started."""

        def integers() -> NDArray[np.int64]:
            return np.zeros(count, np.int64)

        def reals() -> NDArray[np.float64]:
            return np.zeros(count, np.float64)

        return cls(
            poses=np.zeros((count, 4), np.float64),
            episodes=integers(),
            draws=integers(),
            steps=integers(),
            thinks=integers(),
            collisions=integers(),
            path_length=reals(),
            moved=reals(),
            distance=reals(),
            shortest=reals(),
        )

    def start(self, agents: NDArray[np.int64], episodes: NDArray[np.int64], poses: NDArray[np.float64]) -> None:
        """Put the named agents at the start of these episodes; distances are for the caller to look up."""
        self.episodes[agents] = episodes
        self.poses[agents] = poses
        self.draws[agents] += 1
        for counter in (self.steps, self.thinks, self.collisions):
            counter[agents] = 0
        self.path_length[agents] = 0.0
        self.moved[agents] = 0.0

    def state_dict(self) -> dict[str, NDArray[Any]]:
        """Copies of all arrays by name."""
        return {item.name: getattr(self, item.name).copy() for item in fields(self)}

    def load_state_dict(self, state: dict[str, NDArray[Any]]) -> None:
        """Restore what `state_dict` gave. Raises ValueError for arrays that are missing or of another shape."""
        for item in fields(self):
            own = getattr(self, item.name)
            if item.name not in state or np.shape(state[item.name]) != own.shape:
                raise ValueError(
                    f"the saved state of the agents has {item.name} of shape {np.shape(state.get(item.name, ()))}, "
                    f"not {own.shape}; was it saved with another number of envs?"
                )
        for item in fields(self):
            getattr(self, item.name)[...] = state[item.name]
