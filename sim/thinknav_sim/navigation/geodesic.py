"""Walking distances on a navigation grid, by second-order fast marching (scikit-fmm; Sethian, PNAS 1996).

A field is (rows, cols) float32 metres, inf where no path leads. Fields know nothing of objects; `goals` seeds them.
"""

import numpy as np
import skfmm
from numba import njit
from numpy.typing import NDArray

from thinknav_sim.navigation.grid import NavigationGrid


def march(navigable: NDArray[np.bool_], phi: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Walking distance to the contour phi = 0 from outside of it (phi > 0); inf where no path leads, 0 inside.

    navigable, phi: (rows, cols). phi near the contour should be a distance in metres: it places the contour between
    cells.
    """
    if not (navigable & (phi <= 0)).any():
        return np.full(phi.shape, np.inf)
    if not (navigable & (phi > 0)).any():
        return np.where(navigable, 0.0, np.inf)
    marched = skfmm.distance(np.ma.MaskedArray(phi, ~navigable), dx=cell, order=2)
    return np.maximum(np.ma.filled(marched, np.inf), 0.0)


def distance_field(grid: NavigationGrid, targets: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Walking distance from every cell's centre to the centre of the nearest target cell.

    targets: (rows, cols) bool. Returns a field: 0 at targets, inf where none can be reached.
    """
    targets = targets & grid.navigable
    # The contour of a mask lies half a cell outside the centres of its outermost cells: what lies beyond it is that
    # much farther from them.
    outside = march(grid.navigable, np.where(targets, -0.5, 0.5) * grid.cell, grid.cell)
    return np.where(targets, 0.0, outside + 0.5 * grid.cell).astype(np.float32)


@njit(cache=True)
def bilinear(field, origin_x, origin_z, cell, x, z):  # type: ignore[no-untyped-def]
    """Interpolate a field at (x, z), leaving out unreachable cells and the outside; inf where nothing is left."""
    u = (x - origin_x) / cell - 0.5
    v = (z - origin_z) / cell - 0.5
    col, row = int(np.floor(u)), int(np.floor(v))
    total, weights = 0.0, 0.0
    for i in range(2):
        for j in range(2):
            r, c = row + i, col + j
            if 0 <= r < field.shape[0] and 0 <= c < field.shape[1]:
                weight = (v - row if i else 1.0 - (v - row)) * (u - col if j else 1.0 - (u - col))
                if np.isfinite(field[r, c]):
                    total += weight * field[r, c]
                    weights += weight
    return total / weights if weights > 0 else np.inf


@njit(cache=True)
def _lookup(field, origin, cell, positions):  # type: ignore[no-untyped-def]
    distances = np.empty(len(positions))
    for i in range(len(positions)):
        distances[i] = bilinear(field, origin[0], origin[1], cell, positions[i, 0], positions[i, 2])
    return distances


def distances_at(
    grid: NavigationGrid, field: NDArray[np.float32], positions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """A field at positions (N, 3): (N,) float64 metres, inf where nothing can be reached."""
    distances: NDArray[np.float64] = _lookup(field, grid.origin, grid.cell, np.asarray(positions, np.float64))
    return distances


def shortest_path(grid: NavigationGrid, field: NDArray[np.float32], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """The way down a field from a start (3,) to where it is 0: a polyline (K, 3) on the floor, start first.

    Goes down from cell to cell, and is straightened where one can walk straight.
    Raises ValueError for a start that reaches nothing.
    """
    rows, cols = grid.cells(np.asarray(start, np.float64)[None])
    row, col = int(rows[0]), int(cols[0])
    if not grid.is_navigable(np.asarray(start, np.float64)[None])[0] or not np.isfinite(field[row, col]):
        x, _, z = start
        raise ValueError(f"scene {grid.scene_name!r}: no path leads to the goal from x {x:.2f}, z {z:.2f}")
    trail = _descend(field, row, col)
    points = grid.positions(trail[:, 0], trail[:, 1])
    points[0] = start
    corners: NDArray[np.int64] = _straighten(points, grid.navigable, grid.origin, grid.cell)
    return points[corners]


@njit(cache=True)
def steepest_descent(field, row, col):  # type: ignore[no-untyped-def]
    """The neighbour of a cell to which a field falls most steeply, as (row, col); the cell itself at a minimum."""
    best_row, best_col, steepest = row, col, 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            r, c = row + i, col + j
            if 0 <= r < field.shape[0] and 0 <= c < field.shape[1] and (i != 0 or j != 0):
                slope = (field[row, col] - field[r, c]) / np.sqrt(i * i + j * j)
                if slope > steepest:
                    best_row, best_col, steepest = r, c, slope
    return best_row, best_col


@njit(cache=True)
def _descend(field, row, col):  # type: ignore[no-untyped-def]
    trail = [(row, col)]
    while field[row, col] > 0:
        below = steepest_descent(field, row, col)
        if below == (row, col):
            break
        row, col = below
        trail.append((row, col))
    return np.array(trail)


@njit(cache=True)
def _straight(a, b, navigable, origin, cell):  # type: ignore[no-untyped-def]
    pieces = int(np.ceil(np.hypot(b[0] - a[0], b[2] - a[2]) / (0.25 * cell))) + 1
    for k in range(pieces + 1):
        x = a[0] + (b[0] - a[0]) * k / pieces
        z = a[2] + (b[2] - a[2]) * k / pieces
        if not navigable[int((z - origin[1]) // cell), int((x - origin[0]) // cell)]:
            return False
    return True


@njit(cache=True)
def _straighten(points, navigable, origin, cell):  # type: ignore[no-untyped-def]
    kept = [0]
    while kept[-1] < len(points) - 1:
        reach = kept[-1] + 1
        for k in range(kept[-1] + 2, len(points)):
            if not _straight(points[kept[-1]], points[k], navigable, origin, cell):
                break
            reach = k
        kept.append(reach)
    return np.array(kept)
