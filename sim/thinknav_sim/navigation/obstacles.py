"""Which cells of a floor an agent's body cannot enter, straight from the triangles.

Every triangle is cut to the column above each cell it covers, so that nothing is too thin to be noticed: a lamp post of
1 cm blocks its cell. Knows nothing of the agent's radius; `grid` widens the obstacles by it.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

# A triangle clipped by four planes has at most seven corners.
_MAX_CORNERS = 8


@njit(cache=True)
def _clip(polygon, corners, axis, sign, bound, clipped):  # type: ignore[no-untyped-def]
    """Keep the part of a polygon where sign * coordinate <= sign * bound (Sutherland-Hodgman); returns its corners."""
    kept = 0
    for i in range(corners):
        j = i + 1 if i + 1 < corners else 0
        here = sign * (bound - polygon[i, axis])
        there = sign * (bound - polygon[j, axis])
        if here >= 0:
            for k in range(3):
                clipped[kept, k] = polygon[i, k]
            kept += 1
        if (here > 0 and there < 0) or (here < 0 and there > 0):
            share = here / (here - there)
            for k in range(3):
                clipped[kept, k] = polygon[i, k] + share * (polygon[j, k] - polygon[i, k])
            kept += 1
    return kept


@njit(cache=True)
def _extent(polygon, corners, axis):  # type: ignore[no-untyped-def]
    low = high = polygon[0, axis]
    for i in range(1, corners):
        low, high = min(low, polygon[i, axis]), max(high, polygon[i, axis])
    return low, high


@njit(cache=True)
def _cells_between(low, high, origin, cell, count):  # type: ignore[no-untyped-def]
    """First and last of the cells along an axis that an interval touches."""
    first, last = math.floor((low - origin) / cell), math.floor((high - origin) / cell)
    return max(0, first), min(count - 1, last)


@njit(cache=True)
def _mark(vertices, triangles, floor, origin, cell, low, high, slack, blocked):  # type: ignore[no-untyped-def]
    rows, cols = floor.shape
    lowest, highest = np.nanmin(floor) + low, np.nanmax(floor) + high
    polygon = np.empty((_MAX_CORNERS, 3))
    strip = np.empty((_MAX_CORNERS, 3))
    column = np.empty((_MAX_CORNERS, 3))
    scratch = np.empty((_MAX_CORNERS, 3))
    for t in range(len(triangles)):
        for corner in range(3):
            for axis in range(3):
                polygon[corner, axis] = vertices[triangles[t, corner], axis]
        bottom, top = _extent(polygon, 3, 1)
        if top <= lowest or bottom >= highest:
            continue
        low_z, high_z = _extent(polygon, 3, 2)
        first_row, last_row = _cells_between(low_z - slack, high_z + slack, origin[1], cell, rows)
        for row in range(first_row, last_row + 1):
            z = origin[1] + row * cell
            corners = _clip(polygon, 3, 2, -1.0, z - slack, scratch)
            corners = _clip(scratch, corners, 2, 1.0, z + cell + slack, strip)
            if corners == 0:
                continue
            low_x, high_x = _extent(strip, corners, 0)
            first_col, last_col = _cells_between(low_x - slack, high_x + slack, origin[0], cell, cols)
            for col in range(first_col, last_col + 1):
                if blocked[row, col] or not floor[row, col] + low < top or not bottom < floor[row, col] + high:
                    continue
                x = origin[0] + col * cell
                kept = _clip(strip, corners, 0, -1.0, x - slack, scratch)
                kept = _clip(scratch, kept, 0, 1.0, x + cell + slack, column)
                if kept > 0:
                    lowest_here, highest_here = _extent(column, kept, 1)
                    blocked[row, col] = highest_here > floor[row, col] + low and lowest_here < floor[row, col] + high


def blocked_cells(
    vertices: NDArray[np.float32],
    triangles: NDArray[np.int32],
    floor: NDArray[np.float32],
    origin: NDArray[np.float64],
    cell: float,
    low: float,
    high: float,
    slack: float = 0.0,
) -> NDArray[np.bool_]:
    """The cells above whose floor a triangle passes through the band of heights an agent's body takes.

    vertices (V, 3), triangles (T, 3). floor: (rows, cols) height of the floor, NaN where there is none.
    origin: (2,) x and z of the outer corner of cell (0, 0). cell: its side. low, high: the band above the floor.
    slack: how far into a cell's neighbours a triangle counts; more than 0 catches sheets without thickness that lie
    where two cells meet. Metres.
    Returns (rows, cols) bool.
    """
    blocked = np.zeros(floor.shape, np.bool_)
    if np.isfinite(floor).any():
        _mark(vertices, triangles, floor, origin, cell, low, high, slack, blocked)
    return blocked
