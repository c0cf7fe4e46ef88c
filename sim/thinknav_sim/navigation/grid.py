"""Where an agent can stand on one floor of a scene: a grid of 5 cm cells, as a navigation mesh would have it.

Rows run along z and columns along x. Knows nothing of goals, distances or motion. A scene with several floors has one
grid for each. The floor of a scan is followed over steps (`uneven`), as far as no other part of it lies above or below.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from thinknav_sim.navigation.layers import surface_layers
from thinknav_sim.navigation.obstacles import blocked_cells
from thinknav_sim.navigation.uneven import SHEET_SLACK_M, STEP_NOISE_M, follow_floor, too_steep, unblocked
from thinknav_sim.render.renderer import Renderer
from thinknav_sim.scene import Scene, SceneError

# A room of less free floor than this holds no episode; such a scene was read wrongly (units, up-axis, floor height).
MIN_NAVIGABLE_AREA_M2 = 0.5


@dataclass(frozen=True)
class NavigationGrid:
    """The navigable cells of one floor.

    scene_name: whose floor it is.
    origin: (2,) float64, x and z of the outer corner of cell (0, 0). cell: side of a cell. Metres.
    floor: (rows, cols) float32, height of the floor at the cell's centre, NaN where there is none.
    labels: (rows, cols) int32, the connected component that the cell belongs to, largest first from 1; 0 where an agent
        cannot stand. Component 1 is the one that is played in.
    level: whether the floor has one height, but for rugs; not where it was followed over steps.
    """

    scene_name: str
    origin: NDArray[np.float64]
    cell: float
    floor: NDArray[np.float32]
    labels: NDArray[np.int32]
    level: bool = True

    @classmethod
    def from_scene(
        cls,
        scene: Scene,
        renderer: Renderer,
        cell: float = 0.05,
        radius: float = 0.18,
        height: float = 0.88,
        max_climb: float = 0.1,
        floor_height: float | None = None,
        max_step: float = 0.2,
    ) -> "NavigationGrid":
        """Find where an agent of this radius and height can stand.

        Rays cast down find the floor within `max_climb` of `floor_height` (the scene's first floor unless given);
        whatever reaches into the band between `max_climb` and `height` above it blocks, and is widened by `radius`.
        Where the scene's floors are not level, the floor that begins there is followed over steps of `max_step`.
        Raises SceneError where hardly any floor is free, ValueError for lengths that are not positive.
        """
        if min(cell, radius, height, max_climb) <= 0 or max_climb >= height:
            raise ValueError(
                "cell, radius, height and max_climb must be positive and max_climb less than height, "
                f"not {cell}, {radius}, {height}, {max_climb}"
            )
        level = scene.floors[0] if floor_height is None else floor_height
        # One ring of cells around the scene is outside of it, so that its rim is an obstacle too.
        low, high = scene.bounds.low[[0, 2]] - cell, scene.bounds.high[[0, 2]] + cell
        cols, rows = (int(n) for n in np.ceil((high - low) / cell - 1e-6))
        if scene.level_floors:
            floor = _floor_heights(scene, renderer, low, cell, (rows, cols), level, max_climb)
            blocked = blocked_cells(scene.vertices, scene.triangles, floor, low, cell, max_climb, height)
        else:
            steps = max_step + STEP_NOISE_M
            layers = surface_layers(scene, renderer, low, cell, (rows, cols), height)
            layers = unblocked(layers, scene, low, cell, steps, height)
            floor = follow_floor(layers, level, max_climb, max_step, cell)
            blocked = blocked_cells(scene.vertices, scene.triangles, floor, low, cell, steps, height, SHEET_SLACK_M)
            blocked |= too_steep(floor, max_step, radius, cell)
        free = np.isfinite(floor) & ~blocked
        clearance = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * cell
        labels = _components(clearance >= radius)
        area = float((labels == 1).sum()) * cell**2
        if area < MIN_NAVIGABLE_AREA_M2:
            raise SceneError(
                f"scene {scene.name!r} has {area:.2f} m2 of navigable floor at height {level:.2f} m; "
                "is it in metres, y up, and is that the height of its floor?"
            )
        return cls(scene.name, low, cell, floor, labels, scene.level_floors)

    @classmethod
    def from_mask(
        cls,
        scene_name: str,
        mask: NDArray[np.bool_],
        origin: NDArray[np.float64],
        cell: float,
        floor_height: float = 0.0,
        *,
        refine: int = 1,
        widen: float = 0.0,
    ) -> "NavigationGrid":
        """A grid that another program made, as Habitat-Sim's `get_topdown_view`, on a flat floor.

        mask: (rows, cols) bool, whether one can stand at the centre of each cell. origin, cell: as the grid's.
        refine: cells to make of each, along each axis; the rim is then drawn between the centres by linear
        interpolation, without the mask's staircase. widen: metres to keep clear of the rim, for a body that is that
        much wider than the one that the mask was made for.
        Raises SceneError where nothing is navigable, ValueError for a mask or numbers that make no grid.
        """
        if mask.ndim != 2 or mask.dtype != np.bool_:
            raise ValueError(f"a mask is bool of two axes, not {mask.dtype} of shape {mask.shape}")
        if cell <= 0 or refine < 1 or widen < 0:
            raise ValueError(f"cell {cell} must be positive, refine {refine} at least 1, widen {widen} not negative")
        fine = mask if refine == 1 else _refined(mask, refine)
        step = cell / refine
        clearance = ndimage.distance_transform_edt(np.pad(fine, 1))[1:-1, 1:-1] * step
        labels = _components(fine & (clearance >= widen))
        if not labels.any():
            raise SceneError(f"scene {scene_name!r}: no cell of the mask is navigable with {widen} m kept clear")
        floor = np.where(fine, np.float32(floor_height), np.float32(np.nan)).astype(np.float32)
        return cls(scene_name, np.asarray(origin, np.float64), step, floor, labels)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.labels.shape[0], self.labels.shape[1]

    @cached_property
    def navigable(self) -> NDArray[np.bool_]:
        """(rows, cols) bool: the cells of the component that is played in."""
        largest: NDArray[np.bool_] = self.labels == 1
        return largest

    def cells(self, positions: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns, each (N,), of positions (N, 3); they may lie outside the grid."""
        x, z = positions[..., 0], positions[..., 2]
        rows = np.floor((z - self.origin[1]) / self.cell).astype(np.int64)
        return rows, np.floor((x - self.origin[0]) / self.cell).astype(np.int64)

    def positions(self, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> NDArray[np.float64]:
        """(N, 3) points on the floor at the centres of cells."""
        x = self.origin[0] + (cols + 0.5) * self.cell
        z = self.origin[1] + (rows + 0.5) * self.cell
        return np.stack([x, self.floor[rows, cols].astype(np.float64), z], axis=-1)

    def is_navigable(self, positions: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether an agent can stand at positions (N, 3), whose height is not looked at: (N,) bool."""
        rows, cols = self.cells(positions)
        inside = (rows >= 0) & (rows < self.shape[0]) & (cols >= 0) & (cols < self.shape[1])
        return inside & self.navigable[np.where(inside, rows, 0), np.where(inside, cols, 0)]

    def snap(self, positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Move positions (N, 3) that are not navigable to the centre of the nearest cell that is.

        Returns the positions (N, 3), those that are navigable unchanged, and how far each was moved over the floor
        (N,), metres.
        """
        rows, cols = self.cells(positions)
        rows, cols = np.clip(rows, 0, self.shape[0] - 1), np.clip(cols, 0, self.shape[1] - 1)
        centers = self.positions(self._nearest[0, rows, cols], self._nearest[1, rows, cols])
        snapped = np.where(self.is_navigable(positions)[:, None], positions, centers)
        return snapped, np.hypot(*(snapped - positions)[:, [0, 2]].T)

    @cached_property
    def _nearest(self) -> NDArray[np.int32]:
        """(2, rows, cols): row and column of the navigable cell that is nearest to each cell."""
        nearest: NDArray[np.int32] = ndimage.distance_transform_edt(
            ~self.navigable, return_distances=False, return_indices=True
        )
        return nearest

    def random_navigable(self, rng: np.random.Generator, n: int) -> NDArray[np.float64]:
        """(n, 3) float64 positions, uniform over the navigable floor."""
        return self.random_positions(rng, self.navigable, n)

    def random_positions(self, rng: np.random.Generator, mask: NDArray[np.bool_], n: int) -> NDArray[np.float64]:
        """(n, 3) float64 positions, uniform over the cells of a mask (rows, cols). Raises ValueError if it is empty."""
        rows, cols = np.nonzero(mask)
        if not len(rows):
            raise ValueError(f"scene {self.scene_name!r}: no cell to draw positions from")
        picks = rng.integers(len(rows), size=n)
        positions = self.positions(rows[picks], cols[picks])
        # Not quite to the rim, where rounding could carry a point into the next cell.
        positions[:, [0, 2]] += rng.uniform(-0.49, 0.49, size=(n, 2)) * self.cell
        return positions


def _floor_heights(
    scene: Scene,
    renderer: Renderer,
    origin: NDArray[np.float64],
    cell: float,
    shape: tuple[int, int],
    level: float,
    max_climb: float,
) -> NDArray[np.float32]:
    rows, cols = shape
    origins = np.empty((rows, cols, 3), np.float32)
    origins[..., 0] = origin[0] + (np.arange(cols) + 0.5) * cell
    origins[..., 1] = level + max_climb
    origins[..., 2] = (origin[1] + (np.arange(rows) + 0.5) * cell)[:, None]
    down = np.zeros((rows * cols, 3), np.float32)
    down[:, 1] = -1.0
    scene_id = renderer.add_scene(scene)
    try:
        drop = renderer.cast(scene_id, origins.reshape(-1, 3), down).distance.reshape(rows, cols)
    finally:
        renderer.remove_scene(scene_id)
    heights = np.float32(level + max_climb) - drop
    return np.where(drop <= 2 * max_climb, heights, np.float32(np.nan)).astype(np.float32)


def _refined(mask: NDArray[np.bool_], refine: int) -> NDArray[np.bool_]:
    rows, cols = ((np.arange(size * refine) + 0.5) / refine - 0.5 for size in mask.shape)
    points = np.meshgrid(rows, cols, indexing="ij")
    between: NDArray[np.float64] = ndimage.map_coordinates(mask.astype(np.float64), points, order=1, mode="nearest")
    return between >= 0.5


def _components(standable: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Label the 4-connected components from 1, the largest first."""
    labels, count = ndimage.label(standable)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    order = np.zeros(count + 1, np.int32)
    order[1 + np.argsort(-sizes, kind="stable")] = np.arange(1, count + 1)
    ordered: NDArray[np.int32] = order[labels]
    return ordered
