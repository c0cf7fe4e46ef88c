"""Every surface above one another that one could stand on, for floors that are not level.

A home seen as columns of cells: in each, the heights at which rays straight down meet something. `uneven` walks on
them, `scans.floors` finds storeys in them. Knows nothing of goals or motion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.renderer import Renderer
from thinknav_sim.scene import Scene

# A ray goes on this far below what it met.
_SKIN_M = 0.005
_MAX_LAYERS = 48
# Recast's default: steeper than 45 degrees is no floor.
_STEEPEST = np.cos(np.radians(45.0))


@dataclass(frozen=True)
class Layers:
    """Heights of surfaces.

    height: (L, rows, cols) float32 metres, from above down, NaN where there are fewer surfaces.
    standable: (L, rows, cols) bool, level enough and with enough free height above.
    """

    height: NDArray[np.float32]
    standable: NDArray[np.bool_]


def surface_layers(
    scene: Scene, renderer: Renderer, origin: NDArray[np.float64], cell: float, shape: tuple[int, int], height: float
) -> Layers:
    """The surfaces above each cell of a grid.

    origin: (2,) x and z of the outer corner of cell (0, 0). cell: side. shape: rows, cols. height: free height that an
    agent needs above a surface. Metres.
    """
    rows, cols = shape
    corners = scene.vertices[scene.triangles].astype(np.float64)
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    gentle = np.abs(crossed[:, 1]) >= _STEEPEST * np.linalg.norm(crossed, axis=1)
    starts = np.empty((rows * cols, 3), np.float32)
    starts[:, 0] = np.tile(origin[0] + (np.arange(cols) + 0.5) * cell, rows)
    starts[:, 1] = scene.bounds.high[1] + 1.0
    starts[:, 2] = np.repeat(origin[1] + (np.arange(rows) + 0.5) * cell, cols)
    alive = np.arange(rows * cols)
    free = np.full(rows * cols, np.inf, np.float32)
    heights: list[NDArray[np.float32]] = []
    standable: list[NDArray[np.bool_]] = []
    scene_id = renderer.add_scene(scene)
    try:
        while len(alive) and len(heights) < _MAX_LAYERS:
            down = np.tile(np.array([0.0, -1.0, 0.0], np.float32), (len(alive), 1))
            hits = renderer.cast(scene_id, starts[alive], down)
            met = hits.triangle >= 0
            alive, triangle = alive[met], hits.triangle[met]
            met_height = starts[alive, 1] - hits.distance[met]
            heights.append(np.full(rows * cols, np.nan, np.float32))
            standable.append(np.zeros(rows * cols, np.bool_))
            heights[-1][alive] = met_height
            standable[-1][alive] = gentle[triangle] & (free[alive] - met_height >= height)
            free[alive] = met_height
            starts[alive, 1] = met_height - _SKIN_M
    finally:
        renderer.remove_scene(scene_id)
    return Layers(np.stack(heights).reshape(-1, rows, cols), np.stack(standable).reshape(-1, rows, cols))
