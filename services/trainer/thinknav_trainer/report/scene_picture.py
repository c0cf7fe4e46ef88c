"""A scene in one picture: from above, with the floor that an agent can reach, and as the agent would see it.

Knows scenes, renderers and grids; nothing of policies.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy import ndimage

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.render.camera import Camera
from thinknav_sim.scene import Scene
from thinknav_trainer.report.floor_map import PIXEL_M, draw_floor_map

NAVIGABLE_COLOR = (60, 160, 255)
LABEL_COLOR = (200, 30, 60)
VIEW_SIZE = 360
VIEWS = 4  # two by two
_GAP = 8
_LEAST_MAP, _MAX_MAP = 728, 1600


def draw_scene(scene: Scene, renderer: Renderer, grids: Sequence[NavigationGrid], radius: float) -> Image.Image:
    """The floors of a scene from above, one below the other, and views from the first. radius: the agent's, metres."""
    maps = [_map(scene, renderer, grid, level, radius) for grid, level in zip(grids, scene.floors, strict=True)]
    left = max(image.width for image in maps) + _GAP
    views = VIEW_SIZE + _GAP
    width = left + 2 * VIEW_SIZE + _GAP
    height = max(sum(image.height + _GAP for image in maps), 2 * views) - _GAP
    picture = Image.new("RGB", (width, height), (255, 255, 255))
    top = 0
    for image in maps:
        picture.paste(image, (0, top))
        top += image.height + _GAP
    for index, image in enumerate(_views(scene, renderer, grids[0])):
        picture.paste(image, (left + index % 2 * views, index // 2 * views))
    return picture


def _map(scene: Scene, renderer: Renderer, grid: NavigationGrid, level: float, radius: float) -> Image.Image:
    floor_map = draw_floor_map(replace(scene, floors=(level,)), renderer, grid, radius)
    pixels = np.asarray(floor_map.image).astype(np.float64)
    height, width = pixels.shape[:2]
    x = floor_map.origin[0] + (np.arange(width) + 0.5) * PIXEL_M
    z = floor_map.origin[1] + (np.arange(height) + 0.5) * PIXEL_M
    points = np.stack(np.broadcast_arrays(x[None, :], 0.0, z[:, None]), axis=-1).reshape(-1, 3)
    reached = grid.is_navigable(points).reshape(height, width)
    pixels[reached] = 0.6 * pixels[reached] + 0.4 * np.array(NAVIGABLE_COLOR)
    image = Image.fromarray(pixels.astype(np.uint8))
    zoom = max(1, _LEAST_MAP // max(image.size))
    image = image.resize((image.width * zoom, image.height * zoom), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(image)
    for instance in scene.objects:
        if level - 0.5 <= instance.box.low[1] <= level + 2.2:
            low, high = (
                [zoom * at for at in floor_map.pixel(corner[0], corner[2])]
                for corner in (instance.box.low, instance.box.high)
            )
            draw.rectangle((*low, *high), outline=LABEL_COLOR, width=zoom)
            draw.text((low[0] + 3, low[1] + 2), instance.category, fill=LABEL_COLOR)
    image.thumbnail((_MAX_MAP, _MAX_MAP))
    return image


def _views(scene: Scene, renderer: Renderer, grid: NavigationGrid) -> list[Image.Image]:
    """What an agent sees that turns around in the middle of the widest free place."""
    clearance: NDArray[np.float64] = ndimage.distance_transform_edt(np.pad(grid.navigable, 1))[1:-1, 1:-1]
    row, col = np.unravel_index(int(clearance.argmax()), clearance.shape)
    (place,) = grid.positions(np.array([row]), np.array([col]))
    poses = np.array([[*place, 2 * np.pi * turn / VIEWS] for turn in range(VIEWS)])
    scene_id = renderer.add_scene(scene)
    try:
        rgb, _ = renderer.render(np.full(VIEWS, scene_id, np.int64), poses, Camera(width=VIEW_SIZE, height=VIEW_SIZE))
    finally:
        renderer.remove_scene(scene_id)
    return [Image.fromarray(frame) for frame in rgb]
