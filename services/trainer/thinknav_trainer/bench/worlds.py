"""What is drawn in benchmarks: procedural homes as users get them, views in them, and a mesh like a scan's."""

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode, make_episodes
from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene

_EPISODES_A_HOME = 50


def training_homes(count: int) -> list[Scene]:
    """The first homes of the training split."""
    return [generate_home(home_seed("train", index)) for index in range(count)]


def episodes_in(homes: list[Scene]) -> list[Episode]:
    """Episodes of all goals in all the homes."""
    renderer = make_renderer()
    episodes: list[Episode] = []
    for home in homes:
        episodes += make_episodes(
            home, NavigationGrid.from_scene(home, renderer), _EPISODES_A_HOME, 0, renderer=renderer
        )
    renderer.close()
    return episodes


def views_in(home: Scene, count: int) -> NDArray[np.float64]:
    """Poses spread over the home's rooms, half a metre off the walls: (count, 4)."""
    draw = np.random.default_rng(0)
    bounds = np.array([home.rooms[index % len(home.rooms)].bounds for index in range(count)])
    x, z = draw.uniform(bounds[:, :2] + 0.5, bounds[:, 2:] - 0.5).T
    return np.stack([x, np.full(count, home.floors[0]), z, draw.uniform(-np.pi, np.pi, count)], axis=1)


def scan_like(home: Scene, triangles: int, texture_size: int = 4096) -> Scene:
    """The home as a scanner would give it: cut into at least so many small triangles, with one large texture.

    Every triangle has its own corners, which lie on the texture as they do in space, seen along the triangle's normal;
    the texture has about as much area as all triangles together, as an atlas has.
    """
    corners = home.vertices[home.triangles]
    while len(corners) < triangles:
        corners = _cut_in_two(corners, min(triangles - len(corners), len(corners)))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sides = np.array([(2, 1), (0, 2), (0, 1)])[np.abs(normals).argmax(axis=1)]
    width = np.sqrt(np.linalg.norm(normals, axis=1).sum() / 2)
    flat = np.take_along_axis(corners, np.repeat(sides[:, None], 3, axis=1), axis=2)
    noise = np.random.default_rng(0).integers(0, 256, (texture_size, texture_size, 3)).astype(np.uint8)
    return Scene(
        name=f"{home.name} as a scan",
        vertices=corners.reshape(-1, 3),
        triangles=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        colors=np.zeros((3 * len(corners), 3), np.uint8),
        triangle_objects=np.full(len(corners), -1, np.int32),
        floors=home.floors,
        rooms=home.rooms,
        textures=(noise,),
        uv=(flat.reshape(-1, 2) / width).astype(np.float32),
        triangle_textures=np.zeros(len(corners), np.int32),
    )


def _cut_in_two(corners: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    """Triangles (T, 3, 3), the `count` with the longest sides of them halved across that side: (T + count, 3, 3)."""
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    order = np.argsort(-lengths.max(axis=1), kind="stable")
    chosen, rest = corners[order[:count]], corners[order[count:]]
    # Turned so that the longest side runs from corner 0 to corner 1.
    first = lengths[order[:count]].argmax(axis=1)[:, None]
    turned = np.take_along_axis(chosen, ((first + np.arange(3)) % 3)[..., None], axis=1)
    middle = turned[:, :2].mean(axis=1)
    halves = [
        np.stack([turned[:, 0], middle, turned[:, 2]], axis=1),
        np.stack([middle, turned[:, 1], turned[:, 2]], axis=1),
    ]
    return np.concatenate([*halves, rest]).astype(np.float32)
