"""The grids and distance fields of many scenes in flat arrays, so that compiled code can serve many agents at once.

Knows nothing of agents' motion (`kinematics`) nor of how a field is made (`geodesic`).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thinknav_sim.navigation.geodesic import bilinear
from thinknav_sim.navigation.grid import NavigationGrid


class GridTable(NamedTuple):
    """The grids of S scenes in flat arrays, as compiled code wants them.

    navigable, floor: (cells of all scenes,). first: (S,) index of a scene's first cell. shape: (S, 2) rows and columns.
    origin: (S, 2) x and z. cell: (S,) metres. level: (S,) bool, whether a scene's floor has one height.
    """

    navigable: NDArray[np.bool_]
    floor: NDArray[np.float32]
    first: NDArray[np.int64]
    shape: NDArray[np.int64]
    origin: NDArray[np.float64]
    cell: NDArray[np.float64]
    level: NDArray[np.bool_]

    @classmethod
    def of(cls, grids: list[NavigationGrid]) -> "GridTable":
        """The table of these grids, in their order."""
        sizes = [grid.navigable.size for grid in grids]
        return cls(
            navigable=np.concatenate([grid.navigable.ravel() for grid in grids]),
            floor=np.concatenate([grid.floor.ravel() for grid in grids]),
            first=np.cumsum([0, *sizes[:-1]]).astype(np.int64),
            shape=np.array([grid.shape for grid in grids], np.int64),
            origin=np.array([grid.origin for grid in grids], np.float64),
            cell=np.array([grid.cell for grid in grids], np.float64),
            level=np.array([grid.level for grid in grids], np.bool_),
        )


class FieldTable(NamedTuple):
    """F distance fields in one flat array.

    values: float32. first: (F,) index of a field's first value. scene: (F,) which scene of a GridTable it belongs to.
    """

    values: NDArray[np.float32]
    first: NDArray[np.int64]
    scene: NDArray[np.int64]

    @classmethod
    def of(cls, fields: list[NDArray[np.float32]], scenes: list[int]) -> "FieldTable":
        """The table of these fields, in their order; scenes: the index of each one's scene."""
        sizes = [field.size for field in fields]
        return cls(
            values=np.concatenate([field.ravel() for field in fields]),
            first=np.cumsum([0, *sizes[:-1]]).astype(np.int64),
            scene=np.array(scenes, np.int64),
        )


@njit(cache=True)
def cell_at(grids, scene, x, z):  # type: ignore[no-untyped-def]
    """Index into the flat arrays of the cell at (x, z), -1 outside of the grid."""
    row = math.floor((z - grids.origin[scene, 1]) / grids.cell[scene])
    col = math.floor((x - grids.origin[scene, 0]) / grids.cell[scene])
    if row < 0 or row >= grids.shape[scene, 0] or col < 0 or col >= grids.shape[scene, 1]:
        return -1
    return grids.first[scene] + row * grids.shape[scene, 1] + col


@njit(cache=True)
def field_of(grids, fields, index):  # type: ignore[no-untyped-def]
    """One field of a table as (rows, cols)."""
    rows, cols = grids.shape[fields.scene[index]]
    first = fields.first[index]
    return fields.values[first : first + rows * cols].reshape(rows, cols)


@njit(cache=True)
def distances_to_goal(grids, fields, field_ids, poses, agents, distances):  # type: ignore[no-untyped-def]
    """Look up the named agents' distances, in place.

    field_ids: (N,) int64, the field of each agent's goal. poses: (N, 4). agents: (n,) int64. distances: (N,) float64.
    """
    for agent in agents:
        scene = fields.scene[field_ids[agent]]
        distances[agent] = bilinear(
            field_of(grids, fields, field_ids[agent]),
            grids.origin[scene, 0],
            grids.origin[scene, 1],
            grids.cell[scene],
            poses[agent, 0],
            poses[agent, 2],
        )
