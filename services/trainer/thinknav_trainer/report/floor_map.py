"""A home from above, with the way an agent took and the places where it thought.

Knows scenes, renderers and grids; nothing of policies.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy import ndimage

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene

PIXEL_M = 0.02
MARGIN_M = 0.3
CUT_HEIGHT_M = 2.2  # above furniture, below ceilings
WALL_COLOR = (74, 82, 92)
OUTSIDE_COLOR = (255, 255, 255)
PATH_COLOR = (226, 74, 51)
THOUGHT_COLOR = (255, 196, 0)
GOAL_COLOR = (38, 166, 91)


@dataclass(frozen=True)
class FloorMap:
    """A picture of a home from above: x grows to the right, z downwards, so that the first view (-z) looks up."""

    image: Image.Image
    origin: tuple[float, float]  # x, z of the upper left corner

    def pixel(self, x: float, z: float) -> tuple[float, float]:
        """Where a point of the floor lies in the picture."""
        return (x - self.origin[0]) / PIXEL_M, (z - self.origin[1]) / PIXEL_M


def draw_floor_map(scene: Scene, renderer: Renderer, grid: NavigationGrid, radius: float) -> FloorMap:
    """Look down on the home, its ceilings cut away. radius: the agent's, metres."""
    bounds = scene.bounds
    x0, z0 = bounds.low[0] - MARGIN_M, bounds.low[2] - MARGIN_M
    width, height = (int(np.ceil((bounds.high[axis] + MARGIN_M - low) / PIXEL_M)) for axis, low in ((0, x0), (2, z0)))
    xs, zs = x0 + (np.arange(width) + 0.5) * PIXEL_M, z0 + (np.arange(height) + 0.5) * PIXEL_M
    points = np.stack(np.broadcast_arrays(xs[None, :], scene.floors[0] + CUT_HEIGHT_M, zs[:, None]), axis=-1).reshape(
        -1, 3
    )
    scene_id = renderer.add_scene(scene)
    hits = renderer.cast(
        scene_id, points.astype(np.float32), np.tile(np.array([0, -1, 0], np.float32), (len(points), 1))
    )
    renderer.remove_scene(scene_id)
    colors = colors_from_above(scene, points, hits.triangle)
    colors[hits.triangle < 0] = OUTSIDE_COLOR
    picture = colors.reshape(height, width, 3)
    picture[_walls(scene, points, grid, radius).reshape(height, width)] = WALL_COLOR
    return FloorMap(Image.fromarray(picture.astype(np.uint8)), (x0, z0))


def colors_from_above(scene: Scene, points: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    """(P, 3) vertex colours, interpolated, where points (P, 3) lie over their triangles (P,)."""
    corners = scene.triangles[triangles]
    a, b, c = (scene.vertices[corners[:, k]][:, [0, 2]].astype(np.float64) for k in range(3))
    ab, ac, ap = b - a, c - a, points[:, [0, 2]] - a
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    upright = np.abs(area) < 1e-12  # hit on its edge: any of its colours will do
    area[upright] = 1.0
    v = np.where(upright, 0.0, (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / area).clip(0, 1)
    w = np.where(upright, 0.0, (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / area).clip(0, 1)
    weights = np.stack([1 - v - w, v, w], axis=1)
    mixed: NDArray[np.float64] = np.einsum("pk,pkc->pc", weights, scene.colors[corners].astype(np.float64))
    return mixed.clip(0, 255)


def _walls(scene: Scene, points: NDArray[np.float64], grid: NavigationGrid, radius: float) -> NDArray[np.bool_]:
    """Inside the home's outline, but in no room and in no doorway; nothing where rooms are not known."""
    if not scene.rooms:
        return np.zeros(len(points), bool)
    x, z = points[:, 0], points[:, 2]
    rooms = np.zeros(len(points), bool)
    for room in scene.rooms:
        left, top, right, bottom = room.bounds
        rooms |= (x >= left) & (x <= right) & (z >= top) & (z <= bottom)
    low, high = scene.bounds.low, scene.bounds.high
    inside = (x >= low[0]) & (x <= high[0]) & (z >= low[2]) & (z <= high[2])
    walls: NDArray[np.bool_] = inside & ~rooms & ~near_navigable(grid, points, radius)
    return walls


def near_navigable(grid: NavigationGrid, points: NDArray[np.float64], radius: float) -> NDArray[np.bool_]:
    """Whether an agent's body can cover each of the points (N, 3): they are near a place where it can stand."""
    reach = ndimage.distance_transform_edt(~grid.navigable, sampling=grid.cell) <= radius
    rows, columns = grid.cells(points)
    inside = (rows >= 0) & (rows < reach.shape[0]) & (columns >= 0) & (columns < reach.shape[1])
    covered: NDArray[np.bool_] = inside & reach[np.where(inside, rows, 0), np.where(inside, columns, 0)]
    return covered


def draw_path(
    floor_map: FloorMap, scene: Scene, category: str, path: Sequence[Sequence[float]], thoughts: Sequence[int]
) -> Image.Image:
    """The map with the goal objects framed, the path, its start and end, and a dot at each step that thought."""
    image = floor_map.image.copy()
    draw = ImageDraw.Draw(image)
    for instance in scene.objects_of(category):
        low, high = instance.box.low, instance.box.high
        draw.rectangle(
            (*floor_map.pixel(low[0], low[2]), *floor_map.pixel(high[0], high[2])),
            outline=GOAL_COLOR,
            width=4,
        )
    points = [floor_map.pixel(pose[0], pose[2]) for pose in path]
    if len(points) > 1:
        draw.line(points, fill=PATH_COLOR, width=4, joint="curve")
    for step in thoughts:
        _dot(draw, points[step], 6, THOUGHT_COLOR)
    _dot(draw, points[0], 9, (255, 255, 255))
    _arrow(draw, points[-1], path[-1][3])
    return image


def _dot(draw: ImageDraw.ImageDraw, center: tuple[float, float], radius: float, color: tuple[int, int, int]) -> None:
    x, y = center
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=color, outline=(40, 40, 40), width=2)


def _arrow(draw: ImageDraw.ImageDraw, center: tuple[float, float], heading: float) -> None:
    """A triangle that points where the agent looks."""
    corners = [(heading, 15.0), (heading + 2.5, 11.0), (heading - 2.5, 11.0)]
    points = [(center[0] - np.sin(angle) * length, center[1] - np.cos(angle) * length) for angle, length in corners]
    draw.polygon(points, fill=PATH_COLOR, outline=(40, 40, 40))
