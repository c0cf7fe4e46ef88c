"""How far places on the floor are from what an object covers of it, seen from above, and whether it is of their storey.

Knows nothing of grids.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from thinknav_sim.sampling import points_on
from thinknav_sim.scene import Box

# Metres between the points that stand for a triangle: what a distance may be too long by is less.
_SPACING_M = 0.02
# What ends below a floor, or begins above a doorway's height over it, is of another storey. Floors are measured with
# some noise, and things sink into carpets.
_BELOW_FLOOR_M = 0.2
_ABOVE_FLOOR_M = 2.2


def apart_from_box(places: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    """Horizontal metres from places (..., 3) to the footprint of a box, 0 above and below it."""
    outside = np.maximum(box.low - places, places - box.high)[..., [0, 2]]
    distances: NDArray[np.float64] = np.linalg.norm(np.maximum(outside, 0.0), axis=-1)
    return distances


def on_storey_of_box(places: NDArray[np.float64], box: Box) -> NDArray[np.bool_]:
    """Whether a box reaches into the storey above each of some places (..., 3) on a floor; not where that is NaN."""
    low, high = box.low[1] - _ABOVE_FLOOR_M, box.high[1] + _BELOW_FLOOR_M
    reaches: NDArray[np.bool_] = (low <= places[..., 1]) & (places[..., 1] <= high)
    return reaches


def apart_from_triangles(places: NDArray[np.float64], corners: NDArray[np.floating]) -> NDArray[np.float64]:
    """Horizontal metres from places (N, 3) to the nearest of triangles (T, 3, 3), to some two centimetres.

    Infinite where there are no triangles.
    """
    if not len(corners):
        return np.full(len(places), np.inf)
    points, _ = points_on(corners[..., [0, 2]], _SPACING_M)
    distances: NDArray[np.float64] = cKDTree(points).query(places[:, [0, 2]])[0]
    return distances
