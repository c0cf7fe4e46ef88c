"""How hard it is to find one's way in a home: the navigation complexity of Gibson (Xia et al., 2018) and HM3D.

The greatest ratio of walking distance to straight distance between two places. Knows nothing of objects: a home can be
easy to walk and have its goals well hidden.
"""

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation.geodesic import distance_field
from thinknav_sim.navigation.grid import NavigationGrid

# Two places nearer than this do not count: on either side of a wall they make any home a maze.
_APART_M = 1.0
# The search goes on from this many of the best pairs.
_CLIMBS = 8


def navigation_complexity(grid: NavigationGrid, sources: int = 64, seed: int = 0) -> float:
    """The greatest walking distance over straight distance between two places at least 1 m apart; 1 in an empty room.

    Pairs are sought from `sources` cells drawn by the seed to all others. The best go on: from the far end of a pair to
    all others, and so on to and fro while the ratio grows.
    """
    cells = np.argwhere(grid.navigable)
    drawn = np.random.default_rng(seed).choice(len(cells), min(sources, len(cells)), replace=False)
    pairs = sorted((_worst_from(grid, cells, int(cell)) for cell in drawn), reverse=True)
    return max(_climb(grid, cells, *pair) for pair in pairs[:_CLIMBS])


def _worst_from(grid: NavigationGrid, cells: NDArray[np.int64], source: int) -> tuple[float, int]:
    """The greatest ratio from a cell, and to which other; cells: (N, 2) rows and columns."""
    target = np.zeros(grid.shape, np.bool_)
    target[tuple(cells[source])] = True
    walked = distance_field(grid, target)[cells[:, 0], cells[:, 1]]
    straight = np.hypot(*(cells - cells[source]).T) * grid.cell
    ratio = np.where(straight >= _APART_M, walked / np.maximum(straight, _APART_M), 1.0)
    return max(1.0, float(ratio.max())), int(ratio.argmax())


def _climb(grid: NavigationGrid, cells: NDArray[np.int64], ratio: float, other: int) -> float:
    while True:
        greater, other = _worst_from(grid, cells, other)
        if greater <= ratio * (1 + 1e-3):
            return max(ratio, greater)
        ratio = greater
