"""Pictures of a home for people: its plan with rooms and objects named, and views from inside.

Knows scenes, grids and renderers; nothing of runs.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import Camera, Renderer, make_renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.report.floor_map import GOAL_COLOR, FloorMap, draw_floor_map

VIEWS = 4
_VIEW_CAMERA = Camera(width=768, height=576, hfov=90.0, elevation=1.5)
_SPOTS, _HEADINGS = 24, 16
_FAR_M = 6.0  # what lies farther makes a view no better
_ANOTHER_WAY = 0.75  # the cosine of about 40 degrees
_TEXT_COLOR = (20, 20, 20)

# Where one can stand in a room, (K, 3), and the ids of the objects in it.
_Room = tuple[NDArray[np.float64], NDArray[np.int64]]


def write_home_pictures(scene: Scene, folder: Path) -> list[Path]:
    """Write `{scene}-plan.png` and `{scene}-view-1.png` to `-4.png`; returns their paths."""
    config = ObjectNavConfig()
    renderer = make_renderer()
    grid = make_grid(scene, renderer, config)
    folder.mkdir(parents=True, exist_ok=True)
    plan = draw_plan(scene, draw_floor_map(scene, renderer, grid, config.agent_radius))
    pictures = {"plan": plan} | {
        f"view-{number}": view for number, view in enumerate(draw_views(scene, renderer, grid), start=1)
    }
    paths = []
    for name, picture in pictures.items():
        paths.append(folder / f"{scene.name}-{name}.png")
        picture.save(paths[-1])
    return paths


def draw_plan(scene: Scene, floor_map: FloorMap) -> Image.Image:
    """The home from above, its rooms named and the objects that can be goals framed and named."""
    image = floor_map.image.copy()
    draw = ImageDraw.Draw(image)
    for instance in scene.objects:
        if instance.category in GOAL_CATEGORIES:
            low, high = instance.box.low, instance.box.high
            corner = floor_map.pixel(low[0], low[2])
            draw.rectangle((*corner, *floor_map.pixel(high[0], high[2])), outline=GOAL_COLOR, width=2)
            _label(draw, corner, instance.category, 11)
    for room in scene.rooms:
        left, top, right, bottom = room.bounds
        x, y = floor_map.pixel((left + right) / 2, (top + bottom) / 2)
        _label(draw, (x - 4 * len(room.function), y - 9), room.function, 16)
    return image


def _label(draw: ImageDraw.ImageDraw, corner: tuple[float, float], text: str, size: int) -> None:
    """Text from a corner on, or as far to the left of it as the picture's edge demands."""
    font = ImageFont.load_default(size)
    x = min(corner[0], draw.im.size[0] - draw.textlength(text, font) - 4)
    draw.text((x, corner[1]), text, fill=_TEXT_COLOR, font=font, stroke_width=2, stroke_fill=(255, 255, 255))


def draw_views(scene: Scene, renderer: Renderer, grid: NavigationGrid) -> list[Image.Image]:
    """Four views from inside: of the rooms that hold most, in turn, each from where most of it can be seen."""
    rooms = _fullest_rooms(scene, grid)
    scene_id = renderer.add_scene(scene)
    try:
        ranked = [_ranked_poses(scene, renderer, scene_id, places, contents) for places, contents in rooms]
        poses: list[NDArray[np.float64]] = []
        for view in range(VIEWS):
            room = view % len(ranked)
            poses.append(_another(ranked[room], poses[room :: len(ranked)]))
        frames, _ = renderer.render(np.full(VIEWS, scene_id, np.int64), np.array(poses), _VIEW_CAMERA)
    finally:
        renderer.remove_scene(scene_id)
    return [Image.fromarray(frame) for frame in frames]


def _fullest_rooms(scene: Scene, grid: NavigationGrid) -> list[_Room]:
    """The navigable places (K, 3) and object ids of the rooms that hold most; the whole where rooms are not known."""
    places = grid.positions(*np.nonzero(grid.navigable))
    centers = np.array([instance.box.center for instance in scene.objects]).reshape(-1, 3)
    rooms = [(places[_within(places, r.bounds)], np.flatnonzero(_within(centers, r.bounds))) for r in scene.rooms]
    rooms = [room for room in rooms if len(room[0])] or [(places, np.arange(len(centers)))]
    return sorted(rooms, key=lambda room: -len(room[1]))[:VIEWS]


def _within(points: NDArray[np.float64], bounds: tuple[float, float, float, float]) -> NDArray[np.bool_]:
    x0, z0, x1, z1 = bounds
    x, z = points[:, 0], points[:, 2]
    inside: NDArray[np.bool_] = (x >= x0) & (x <= x1) & (z >= z0) & (z <= z1)
    return inside


def _ranked_poses(
    scene: Scene, renderer: Renderer, scene_id: int, places: NDArray[np.float64], contents: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Poses (N, 4) at places all over a room, those that show most of its contents first, and then most of the room."""
    spots = places[np.linspace(0, len(places) - 1, _SPOTS).astype(np.int64)]
    headings = np.linspace(-np.pi, np.pi, _HEADINGS, endpoint=False)
    poses = np.column_stack([np.repeat(spots, _HEADINGS, axis=0), np.tile(headings, _SPOTS)])
    # A fan of rays below and about eye level stands for the picture.
    across, down = np.meshgrid(np.linspace(-0.9, 0.9, 24), np.linspace(-0.6, 0.1, 8))
    sine, cosine = np.sin(poses[:, 3, None]), np.cos(poses[:, 3, None])
    right, up = across.ravel()[None], down.ravel()[None]
    directions = np.stack([cosine * right - sine, up + 0 * sine, -sine * right - cosine], axis=-1)
    origins = np.broadcast_to((poses[:, :3] + (0.0, _VIEW_CAMERA.elevation, 0.0))[:, None], directions.shape)
    hits = renderer.cast(scene_id, *(rays.reshape(-1, 3).astype(np.float32) for rays in (origins, directions)))
    owners = np.where(hits.triangle >= 0, scene.triangle_objects[hits.triangle], -1).reshape(len(poses), -1)
    shown = (owners[:, :, None] == contents).any(axis=1).sum(axis=1)
    # A wall before one's nose spoils a picture.
    open_view = np.sqrt(np.minimum(hits.distance, _FAR_M)).reshape(len(poses), -1).mean(axis=1)
    ranked: NDArray[np.float64] = poses[np.lexsort([-open_view, -shown])]
    return ranked


def _another(ranked: NDArray[np.float64], taken: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The best pose that looks another way than those that were taken."""
    for pose in ranked:
        if all(np.cos(pose[3] - other[3]) < _ANOTHER_WAY for other in taken):
            best: NDArray[np.float64] = pose
            return best
    first: NDArray[np.float64] = ranked[0]
    return first
