"""Ways on an agent's own map: to where it can stand before a thing, or to the nearest rim of what it knows.

Plans with the simulator's grids and distance fields, on a map in the place of the true floor. Knows nothing of steps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from thinknav_sim.navigation import GridTable, NavigationGrid, distance_field, distances_at
from thinknav_trainer.obstacle_kernels import BLOCKED, FREE, UNKNOWN
from thinknav_trainer.occupancy import CELL_M, HALF_M, OccupancyMap

# A rim of fewer cells is no way on.
RIM_CELLS = 5
# The agent stands where it stands, whatever the map says of how near things are.
_FOOTHOLD_M = 0.1
_AROUND = np.ones((3, 3), np.bool_)
Part = tuple[slice, slice]


@dataclass(frozen=True)
class Way:
    """Where one can walk, and the metres (rows, cols) from each cell to the nearest target.

    to_goal: whether the targets lie before the goal.
    """

    grid: NavigationGrid
    metres: NDArray[np.float32]
    to_goal: bool

    @property
    def table(self) -> GridTable:
        """The grid alone in a table."""
        return GridTable.of([self.grid])

    def left(self, pose: NDArray[np.float64]) -> float:
        """Metres from a pose (4,) to the nearest target; inf where no way leads there."""
        return float(distances_at(self.grid, self.metres, pose[None])[0])


class Floor:
    """What of a map an agent can walk on that keeps clear of all that blocks, and can reach from where it is.

    pose: (4,) of the agent. clearance: metres between its centre and the middle of what blocks.
    """

    def __init__(self, known: OccupancyMap, pose: NDArray[np.float64], clearance: float) -> None:
        self.part: Part = known.known_part()
        self._state = known.state[self.part]
        clear = ndimage.distance_transform_edt(self._state != BLOCKED) * CELL_M >= clearance
        walkable = np.zeros(known.state.shape, np.bool_)
        walkable[self.part] = clear & (self._state == FREE)
        walkable[known.near(pose, _FOOTHOLD_M)] = True
        row, col = known.cells(pose[[0, 2]])
        labels, _ = ndimage.label(walkable[self.part])  # no way leads between cells that touch at a corner alone
        self.reachable: NDArray[np.bool_] = labels == labels[row - self.part[0].start, col - self.part[1].start]

    def before(self, goal: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
        """Where one can stand within `reach` metres of the goal's cells. goal: (rows, cols) of the map, of this part.

        The results of this and of `rims` are (rows, cols) of this part.
        """
        here = goal[self.part]
        if not here.any():
            return np.zeros(here.shape, np.bool_)
        near: NDArray[np.bool_] = ndimage.distance_transform_edt(~here) * CELL_M <= reach
        return self.reachable & near

    def rims(self, looked: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Where one can stand beside what is unknown, but for where that was `looked` at: (rows, cols) of the map."""
        beside = self.reachable & ndimage.binary_dilation(self._state == UNKNOWN, _AROUND) & ~looked[self.part]
        labels, count = ndimage.label(beside, _AROUND)
        sizes = np.bincount(labels.ravel(), minlength=count + 1)
        rims: NDArray[np.bool_] = beside & (sizes[labels] >= RIM_CELLS)
        return rims

    def way(self, targets: NDArray[np.bool_], to_goal: bool) -> Way:
        """To the nearest of some targets (rows, cols) that can be reached."""
        origin = np.array([self.part[1].start, self.part[0].start]) * CELL_M - HALF_M
        floor = np.zeros(self.reachable.shape, np.float32)
        grid = NavigationGrid("map", origin, CELL_M, floor, self.reachable.astype(np.int32))
        return Way(grid, distance_field(grid, targets), to_goal)
