"""A floor whose height changes: followed from cell to cell over steps, as one walks it.

Where surfaces lie above one another, each cell belongs to the one nearest in height to where the floor began, so that a
storey keeps its own floor and stairs lead on from it. Knows nothing of goals or motion.
"""

import heapq

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from thinknav_sim.navigation.layers import Layers
from thinknav_sim.navigation.obstacles import blocked_cells
from thinknav_sim.scene import Scene

# Steps are measured on scans: this much is noise.
STEP_NOISE_M = 0.02
# Holes of the scan up to twice this wide are floor, where no other surface lies below them.
_HOLE_M = 0.25
_BELOW_HOLE_M = 1.5
# Walls of scans may have no thickness; rounding must not lose those that lie where two cells meet.
SHEET_SLACK_M = 1e-5
_ROW_STEPS = (1, -1, 0, 0)
_COL_STEPS = (0, 0, 1, -1)


@njit(cache=True)
def _connected(height, standable, step):  # type: ignore[no-untyped-def]
    """(L, rows, cols) which connected part of all surfaces each one belongs to, from 1; 0 where nobody stands."""
    layers, rows, cols = height.shape
    parts = np.zeros(height.shape, np.int32)
    count = 0
    for k in range(layers):
        for row in range(rows):
            for col in range(cols):
                if not standable[k, row, col] or parts[k, row, col] > 0:
                    continue
                count += 1
                parts[k, row, col] = count
                stack = [(k, row, col)]
                while len(stack) > 0:
                    at, y, x = stack.pop()
                    for side in range(4):
                        r, c = y + _ROW_STEPS[side], x + _COL_STEPS[side]
                        if 0 <= r < rows and 0 <= c < cols:
                            for to in range(layers):
                                if (
                                    standable[to, r, c]
                                    and parts[to, r, c] == 0
                                    and abs(height[to, r, c] - height[at, y, x]) <= step
                                ):
                                    parts[to, r, c] = count
                                    stack.append((to, r, c))
    return parts


@njit(cache=True)
def _follow(height, standable, seeds, level, step, floor):  # type: ignore[no-untyped-def]
    """Walk from the seeds (L, rows, cols) over cells of `floor` that have no height yet, in place."""
    layers, rows, cols = height.shape
    heap = [(0.0, 0, 0, 0)]
    heap.pop()
    for k in range(layers):
        for row in range(rows):
            for col in range(cols):
                if seeds[k, row, col]:
                    heapq.heappush(heap, (abs(float(height[k, row, col]) - level), k, row, col))
    while len(heap) > 0:
        _, k, row, col = heapq.heappop(heap)
        if not np.isnan(floor[row, col]):
            continue
        here = height[k, row, col]
        floor[row, col] = here
        for side in range(4):
            r, c = row + _ROW_STEPS[side], col + _COL_STEPS[side]
            if 0 <= r < rows and 0 <= c < cols and np.isnan(floor[r, c]):
                for to in range(layers):
                    if standable[to, r, c] and abs(height[to, r, c] - here) <= step:
                        heapq.heappush(heap, (abs(float(height[to, r, c]) - level), to, r, c))


def follow_floor(layers: Layers, level: float, max_climb: float, max_step: float, cell: float) -> NDArray[np.float32]:
    """(rows, cols) height of the floor that starts within `max_climb` of `level`, NaN where there is none. Metres.

    max_step: how much it may rise or fall from a cell to the next. Small holes are filled.
    """
    step = max_step + STEP_NOISE_M
    seeds = layers.standable & (np.abs(np.nan_to_num(layers.height, nan=np.inf) - level) <= max_climb)
    parts = _connected(layers.height, layers.standable, step)
    floor = np.full(layers.height.shape[1:], np.nan, np.float32)
    if not seeds.any():
        return floor
    # The part with most floor on this level goes first: what lies walled in under its stairs must not take their place.
    main = int(np.bincount(parts[seeds]).argmax())
    for group in (seeds & (parts == main), seeds & (parts != main)):
        _follow(layers.height, layers.standable, group, float(level), step, floor)
    known = np.isfinite(floor)
    # Padded, so that the rim of the grid does not eat from the closing.
    reach = int(np.ceil(_HOLE_M / cell))
    closed = ndimage.binary_closing(np.pad(known, reach), disc(_HOLE_M, cell))[reach:-reach, reach:-reach]
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = floor[tuple(nearest)]
    drop = filled - layers.height
    pit = np.any((drop > step) & (drop < _BELOW_HOLE_M), axis=0)
    return np.where(known | (closed & ~pit), filled, np.float32(np.nan)).astype(np.float32)


def unblocked(
    layers: Layers, scene: Scene, origin: NDArray[np.float64], cell: float, low: float, high: float
) -> Layers:
    """The layers without the places where something stands between `low` and `high` above them. Metres."""
    standable = layers.standable.copy()
    for height, stood in zip(layers.height, standable, strict=True):
        if stood.any():
            surface = np.where(stood, height, np.float32(np.nan))
            stood &= ~blocked_cells(scene.vertices, scene.triangles, surface, origin, cell, low, high, SHEET_SLACK_M)
    return Layers(layers.height, standable)


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
