"""The storeys of a scan: the heights at which there is much surface that one can stand on.

Knows nothing of how one walks between them.
"""

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation.layers import surface_layers
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene, SceneError

_CELL_M = 0.1
_BIN_M = 0.05
# Surfaces within this of a peak are the same floor.
_BAND_M = 0.1
_STOREY_M = 1.5
# A floor is at least this large, absolutely and beside the largest; tables and cupboards are not.
_LEAST_AREA_M2 = 1.0
_LEAST_SHARE = 0.2
# Above a floor there are walls; above a roof there is nothing.
_WALL_M = 1.2
_HEADROOM_M = 0.88
_HEIGHT_DIGITS = 5  # of a floor's height in metres


def find_floors(scene: Scene, renderer: Renderer) -> tuple[float, ...]:
    """The heights of a scene's floors, metres, the largest floor first. Raises SceneError where there is none."""
    low, high = scene.bounds.low, scene.bounds.high
    cols, rows = (max(1, int(np.ceil((high[axis] - low[axis]) / _CELL_M))) for axis in (0, 2))
    layers = surface_layers(scene, renderer, low[[0, 2]], _CELL_M, (rows, cols), _HEADROOM_M)
    heights = layers.height[layers.standable].astype(np.float64)
    floors: list[tuple[float, float]] = []
    while len(heights):
        peak = _densest(heights)
        near = np.abs(heights - peak) <= _BAND_M
        area = float(near.sum()) * _CELL_M**2
        if area < max(_LEAST_AREA_M2, _LEAST_SHARE * max((size for size, _ in floors), default=0.0)):
            break
        # Rays meet a floor a hair above or below it, by the width of the processor's vectors.
        floors.append((area, round(float(np.median(heights[near])), _HEIGHT_DIGITS)))
        heights = heights[np.abs(heights - peak) > _STOREY_M]
    if not floors:
        raise SceneError(
            f"scene {scene.name!r} has no floor that one can stand on; "
            "is it a home, and are its units and up-axis right?"
        )
    lowest = min(level for _, level in floors)
    storeys = [(area, level) for area, level in floors if level == lowest or level + _WALL_M <= high[1]]
    return tuple(level for _, level in sorted(storeys, reverse=True))


def _densest(heights: NDArray[np.float64]) -> float:
    """The middle of the band that holds most of the heights; the lowest of equals."""
    start = heights.min()
    counts = np.bincount(((heights - start) / _BIN_M).astype(np.int64))
    width = round(2 * _BAND_M / _BIN_M)
    sums = np.convolve(counts, np.ones(width), mode="full")[width - 1 :]
    first = int(np.argmax(sums))
    inside = heights[(heights >= start + first * _BIN_M) & (heights <= start + (first + width) * _BIN_M)]
    return float(np.median(inside))
