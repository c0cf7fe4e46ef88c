"""What N agents have done in their episodes so far, and whether they did as they were told.

Knows nothing of what is made of it (`farming`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_Row = tuple[float, float, float, int, int]


@dataclass(frozen=True)
class Trajectory:
    """An episode of T steps.

    places: (T, 2) metres, x and z before each step. headings: (T,) radians, before each step. actions: (T,) int64.
    agreements: (T,) int64, +1 the action did what the subgoal before it said, -1 something else, 0 nothing was judged.
    """

    places: NDArray[np.float64]
    headings: NDArray[np.float64]
    actions: NDArray[np.int64]
    agreements: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.actions)


class Trajectories:
    """Those of N agents, each from the beginning of its episode."""

    def __init__(self, count: int) -> None:
        self._rows: list[list[_Row]] = [[] for _ in range(count)]

    def note(
        self,
        agents: NDArray[np.integer],
        poses: NDArray[np.float64],
        actions: NDArray[np.int64],
        agreements: NDArray[np.int8],
    ) -> None:
        """Some agents (n,) acted from poses (n, 4)."""
        columns = (agents, poses[:, 0], poses[:, 2], poses[:, 3], actions, agreements)
        for agent, *row in zip(*(column.tolist() for column in columns), strict=True):
            self._rows[agent].append((row[0], row[1], row[2], row[3], row[4]))

    def of(self, agent: int) -> Trajectory:
        """An agent's, as far as it has come."""
        table = np.array(self._rows[agent], np.float64).reshape(-1, 5)
        return Trajectory(table[:, :2], table[:, 2], table[:, 3].astype(np.int64), table[:, 4].astype(np.int64))

    def forget(self, agents: Iterable[int]) -> None:
        """Their episodes have ended."""
        for agent in agents:
            self._rows[agent] = []

    def state_dict(self) -> list[NDArray[np.float64]]:
        """(T, 5) of each agent."""
        return [np.array(rows, np.float64).reshape(-1, 5) for rows in self._rows]

    def load_state_dict(self, state: Sequence[NDArray[np.float64]]) -> None:
        """Go on where `state_dict` was taken."""
        self._rows = [[(x, z, h, int(action), int(judged)) for x, z, h, action, judged in table] for table in state]
