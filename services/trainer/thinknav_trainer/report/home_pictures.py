"""Pictures of a home for people: its plan with rooms and objects named, and views from inside.

Knows scenes, grids and renderers; nothing of runs.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Camera, Renderer, make_renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.report.floor_map import GOAL_COLOR, FloorMap, draw_floor_map

VIEWS = 4
_VIEW_CAMERA = Camera(width=768, height=576, hfov=90.0, elevation=1.5)
_GLANCE_CAMERA = Camera(width=32, height=24, hfov=90.0, elevation=1.5)
_SPOTS, _HEADINGS = 24, 16
_FAR_M = 6.0  # what lies farther makes a view no better
_TEXT_COLOR = (20, 20, 20)


def write_home_pictures(scene: Scene, folder: Path) -> list[Path]:
    """Write `{scene}-plan.png` and `{scene}-view-1.png` to `-4.png`; returns their paths."""
    config = ObjectNavConfig()
    renderer = make_renderer()
    grid = NavigationGrid.from_scene(scene, renderer, radius=config.agent_radius, height=config.agent_height)
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
    draw.text(
        corner, text, fill=_TEXT_COLOR, font=ImageFont.load_default(size), stroke_width=2, stroke_fill=(255, 255, 255)
    )


def draw_views(scene: Scene, renderer: Renderer, grid: NavigationGrid) -> list[Image.Image]:
    """Four views from inside: of the largest rooms in turn, each from where and to where one sees farthest."""
    areas = _room_places(scene, grid)
    scene_id = renderer.add_scene(scene)
    try:
        ranked = [_ranked_poses(renderer, scene_id, area) for area in areas]
        poses = [_another(ranked[view % len(ranked)], view // len(ranked)) for view in range(VIEWS)]
        frames, _ = renderer.render(np.full(VIEWS, scene_id, np.int64), np.array(poses), _VIEW_CAMERA)
    finally:
        renderer.remove_scene(scene_id)
    return [Image.fromarray(frame) for frame in frames]


def _room_places(scene: Scene, grid: NavigationGrid) -> list[NDArray[np.float64]]:
    """The navigable places (K, 3) of each of the largest rooms, or of the whole where rooms are not known."""
    places = grid.positions(*np.nonzero(grid.navigable))
    x, z = places[:, 0], places[:, 2]
    rooms = [
        places[(x >= x0) & (x <= x1) & (z >= z0) & (z <= z1)] for x0, z0, x1, z1 in (r.bounds for r in scene.rooms)
    ]
    return sorted((room for room in rooms if len(room)), key=len, reverse=True)[:VIEWS] or [places]


def _ranked_poses(renderer: Renderer, scene_id: int, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Poses (N, 4) at places all over a room, those that see farthest first."""
    spots = places[np.linspace(0, len(places) - 1, _SPOTS).astype(np.int64)]
    headings = np.linspace(-np.pi, np.pi, _HEADINGS, endpoint=False)
    poses = np.column_stack([np.repeat(spots, _HEADINGS, axis=0), np.tile(headings, _SPOTS)])
    _, depth = renderer.render(np.full(len(poses), scene_id, np.int64), poses, _GLANCE_CAMERA)
    # A picture is as good as its nearer parts are far: a wall before one's nose spoils it.
    seen = np.sqrt(np.minimum(depth, _FAR_M)).mean(axis=(1, 2, 3))
    ranked: NDArray[np.float64] = poses[np.argsort(-seen, kind="stable")]
    return ranked


def _another(ranked: NDArray[np.float64], number: int) -> NDArray[np.float64]:
    """The best pose, or the best that looks at least a quarter turn away from the one before, and so on."""
    best: NDArray[np.float64] = ranked[0]
    for _ in range(number):
        away = np.cos(ranked[:, 3] - best[3]) < 0.1
        best = ranked[np.flatnonzero(away)[0]]
    return best
