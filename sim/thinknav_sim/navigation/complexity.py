"""How hard it is to find one's way in a home: the navigation complexity of Gibson (Xia et al., 2018) and HM3D.

The greatest ratio of walking distance to straight distance between two places. Knows nothing of objects: a home can be
easy to walk and have its goals well hidden.
"""

import numpy as np

from thinknav_sim.navigation.geodesic import distance_field
from thinknav_sim.navigation.grid import NavigationGrid

# Two places nearer than this do not count: on either side of a wall they make any home a maze.
_APART_M = 1.0


def navigation_complexity(grid: NavigationGrid, sources: int = 128, seed: int = 0) -> float:
    """The greatest walking distance over straight distance between two places at least 1 m apart; 1 in an empty room.

    Measured from `sources` cells drawn by the seed to every other cell; more of them find a slightly greater ratio.
    """
    rows, cols = np.nonzero(grid.navigable)
    centers = grid.positions(rows, cols)
    picks = np.random.default_rng(seed).choice(len(rows), min(sources, len(rows)), replace=False)
    greatest = 1.0
    for pick in picks:
        target = np.zeros(grid.shape, np.bool_)
        target[rows[pick], cols[pick]] = True
        walked = distance_field(grid, target)[rows, cols]
        straight = np.hypot(*(centers - centers[pick])[:, [0, 2]].T)
        far = straight >= _APART_M
        greatest = max(greatest, float((walked[far] / straight[far]).max(initial=1.0)))
    return greatest
