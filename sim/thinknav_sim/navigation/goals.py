"""Where an object counts as found, and how far it is from everywhere.

The success zone of an object: the navigable cells from which it can be seen and whose walking distance to it is at most
the success distance, of the storey that it stands in. These cells are what Habitat calls viewpoints. Knows nothing of
agents' headings or of episodes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation.footprint import apart_from_box, apart_from_triangles, on_storey_of_box
from thinknav_sim.navigation.geodesic import distance_field, march
from thinknav_sim.navigation.grid import NavigationGrid
from thinknav_sim.navigation.visibility import sees_points, surface_points
from thinknav_sim.render.renderer import Renderer
from thinknav_sim.scene import ObjectInstance, Scene

# An object is reached from the cells that are at most this much farther from it than the nearest is.
_REACH_CELLS = 2.0


@dataclass(frozen=True)
class GoalObject:
    """One instance of a goal category that can be reached.

    points: (P, 3) float64, points on its surface. zone: (rows, cols) bool, its success zone.
    """

    instance: ObjectInstance
    points: NDArray[np.float64]
    zone: NDArray[np.bool_]


@dataclass(frozen=True)
class Goal:
    """A category in a scene.

    objects: its instances that can be reached; none when the category cannot be.
    zone: (rows, cols) bool, the union of theirs. distance: (rows, cols) float32, walking distance to the zone.
    """

    category: str
    objects: tuple[GoalObject, ...]
    zone: NDArray[np.bool_]
    distance: NDArray[np.float32]


def find_goal(
    scene: Scene,
    grid: NavigationGrid,
    renderer: Renderer,
    scene_id: int,
    category: str,
    *,
    success_distance: float = 1.0,
    camera_height: float = 0.88,
) -> Goal:
    """Find where the objects of a category can be seen from within walking `success_distance`, and the way there.

    scene_id: the renderer's. An instance that nobody can come near, or see from there, is left out.
    """
    found = []
    for instance in scene.objects_of(category):
        points = surface_points(scene, instance.object_id)
        near = _Window(scene, grid, instance, success_distance)
        eyes = near.positions()
        eyes[:, 1] += camera_height
        seen = sees_points(renderer, scene_id, scene.triangle_objects, eyes, points, instance.object_id)
        zone = near.zone(np.any(seen, axis=1), success_distance)
        if zone.any():
            found.append(GoalObject(instance, points, zone))
    union = np.zeros(grid.shape, np.bool_)
    for goal_object in found:
        union |= goal_object.zone
    return Goal(category, tuple(found), union, distance_field(grid, union))


class _Window:
    """The part of a grid around an object; what lies beyond is farther from it than the success distance."""

    def __init__(self, scene: Scene, grid: NavigationGrid, instance: ObjectInstance, reach: float) -> None:
        limits = np.stack([instance.box.low - reach, instance.box.high + reach])
        (row0, row1), (col0, col1) = grid.cells(limits)
        self.grid = grid
        self.rows = slice(max(0, row0 - 1), max(0, row1 + 2))
        self.cols = slice(max(0, col0 - 1), max(0, col1 + 2))
        self.navigable = grid.navigable[self.rows, self.cols]
        rows, cols = np.indices(self.navigable.shape)
        centers = grid.positions(rows + self.rows.start, cols + self.cols.start)
        # Horizontal distance to the object's footprint.
        self.apart = apart_from_box(centers, instance.box)
        standing = self.navigable & on_storey_of_box(centers, instance.box)
        near = standing & (self.apart <= reach)
        if not scene.level_floors:  # what stands in a scan stands at any angle, and its box has empty corners
            self.apart[near] = apart_from_triangles(centers[near], scene.triangles_of(instance.object_id))
        self.near = standing & (self.apart <= reach)
        self.centers = centers

    def positions(self) -> NDArray[np.float64]:
        """(K, 3): the navigable cells within reach of the footprint."""
        positions: NDArray[np.float64] = self.centers[self.near]
        return positions

    def zone(self, visible: NDArray[np.bool_], reach: float) -> NDArray[np.bool_]:
        """The success zone on the whole grid, from which of `positions()` see the object (K,).

        Walking distance is that to the nearest cells which see the object, and from there straight to its footprint.
        """
        seeing = np.zeros(self.navigable.shape, np.bool_)
        seeing[self.near] = visible
        zone = np.zeros(self.grid.shape, np.bool_)
        if seeing.any():
            cell = self.grid.cell
            rim = float(self.apart[seeing].min()) + _REACH_CELLS * cell
            beside = seeing & (self.apart <= rim)
            phi = np.where(beside, np.minimum(self.apart - rim, 0.0), np.maximum(self.apart - rim, 0.5 * cell))
            walked = np.where(beside, self.apart, rim + march(self.navigable, phi, cell))
            zone[self.rows, self.cols] = seeing & (walked <= reach)
        return zone
