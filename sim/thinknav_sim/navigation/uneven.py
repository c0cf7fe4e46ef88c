"""A floor whose height changes: followed from cell to cell over steps, as one walks it.

Where surfaces lie above one another, each cell belongs to the one nearest in height to where the floor began, so that a
storey keeps its own floor and stairs lead on from it. Knows nothing of obstacles; `obstacles` blocks what stands on it.
"""

import heapq

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from thinknav_sim.navigation.layers import Layers

# Steps are measured on scans: this much is noise.
STEP_NOISE_M = 0.02
# Holes of the scan up to twice this wide are floor, where no other surface lies below them.
_HOLE_M = 0.25
_BELOW_HOLE_M = 1.5


@njit(cache=True)
def _follow(height, standable, level, start, step):  # type: ignore[no-untyped-def]
    layers, rows, cols = height.shape
    floor = np.full((rows, cols), np.nan, np.float32)
    heap = [(0.0, 0, 0, 0)]
    heap.pop()
    for k in range(layers):
        for row in range(rows):
            for col in range(cols):
                if standable[k, row, col] and abs(height[k, row, col] - level) <= start:
                    heapq.heappush(heap, (abs(float(height[k, row, col]) - level), k, row, col))
    while len(heap) > 0:
        _, k, row, col = heapq.heappop(heap)
        if not np.isnan(floor[row, col]):
            continue
        here = height[k, row, col]
        floor[row, col] = here
        for side in range(4):
            r = row + (1 if side == 0 else -1 if side == 1 else 0)
            c = col + (1 if side == 2 else -1 if side == 3 else 0)
            if 0 <= r < rows and 0 <= c < cols and np.isnan(floor[r, c]):
                for other in range(layers):
                    if standable[other, r, c] and abs(height[other, r, c] - here) <= step:
                        heapq.heappush(heap, (abs(float(height[other, r, c]) - level), other, r, c))
    return floor


def follow_floor(layers: Layers, level: float, max_climb: float, max_step: float, cell: float) -> NDArray[np.float32]:
    """(rows, cols) height of the floor that starts within `max_climb` of `level`, NaN where there is none. Metres.

    max_step: how much it may rise or fall from a cell to the next. Small holes are filled.
    """
    floor: NDArray[np.float32] = _follow(
        layers.height, layers.standable, float(level), float(max_climb), max_step + STEP_NOISE_M
    )
    known = np.isfinite(floor)
    if not known.any():
        return floor
    # Padded, so that the rim of the grid does not eat from the closing.
    reach = int(np.ceil(_HOLE_M / cell))
    closed = ndimage.binary_closing(np.pad(known, reach), disc(_HOLE_M, cell))[reach:-reach, reach:-reach]
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = floor[tuple(nearest)]
    drop = filled - layers.height
    pit = np.any((drop > max_step + STEP_NOISE_M) & (drop < _BELOW_HOLE_M), axis=0)
    return np.where(known | (closed & ~pit), filled, np.float32(np.nan)).astype(np.float32)


def too_steep(floor: NDArray[np.float32], max_step: float, radius: float, cell: float) -> NDArray[np.bool_]:
    """(rows, cols) bool: cells from which the floor rises or falls by more than a step within the agent's radius."""
    missing = np.isnan(floor)
    around = disc(radius, cell)
    highest = ndimage.maximum_filter(np.where(missing, -np.inf, floor), footprint=around, mode="constant", cval=-np.inf)
    lowest = ndimage.minimum_filter(np.where(missing, np.inf, floor), footprint=around, mode="constant", cval=np.inf)
    limit = max_step + STEP_NOISE_M
    with np.errstate(invalid="ignore"):
        steep: NDArray[np.bool_] = (highest - floor > limit) | (floor - lowest > limit)
    return steep


def disc(radius: float, cell: float) -> NDArray[np.bool_]:
    """The cells whose centres lie within a radius of the middle one."""
    reach = int(radius / cell + 1e-6)
    steps = np.arange(-reach, reach + 1)
    inside: NDArray[np.bool_] = np.hypot(*np.meshgrid(steps, steps)) * cell <= radius + 1e-6
    return inside
