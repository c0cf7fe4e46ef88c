"""Hand-made scenes whose pictures can be worked out on paper, and every renderer to draw them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from thinknav_sim.render import EmbreeRenderer, Open3DRenderer, RasterRenderer, Renderer, WarpRenderer
from thinknav_sim.scene import Scene

Quad = tuple[Sequence[Sequence[float]], Sequence[Sequence[int]]]

MAKERS: dict[str, Callable[[], Renderer]] = {
    "raster": lambda: RasterRenderer(EmbreeRenderer()),
    "embree": EmbreeRenderer,
    "embree-4": lambda: EmbreeRenderer(packet_width=4),
    "embree-8": lambda: EmbreeRenderer(packet_width=8),
    "embree-16": lambda: EmbreeRenderer(packet_width=16),
    "open3d": Open3DRenderer,
    "warp": WarpRenderer,
}

FRONT, LEFT, BACK, RIGHT, FLOOR, CEILING = (
    (200, 0, 0),
    (0, 200, 0),
    (200, 200, 0),
    (0, 0, 200),
    (40, 40, 40),
    (240, 240, 240),
)


def scene_of(name: str, quads: Sequence[Quad]) -> Scene:
    """A scene of quads, each (four corners in order round the edge, four colours)."""
    corners = np.array([corner for quad in quads for corner in quad[0]], np.float32)
    colors = np.array([color for quad in quads for color in quad[1]], np.uint8)
    first = 4 * np.arange(len(quads))[:, None]
    triangles = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3).astype(np.int32)
    return Scene(name, corners, triangles, colors, np.full(len(triangles), -1, np.int32))


def cuboid(low: Sequence[float], high: Sequence[float], colors: Sequence[Sequence[int]]) -> list[Quad]:
    """The faces of a box in the colours of: front (-z), left (-x), back (+z), right (+x), floor, ceiling."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    faces = [
        [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)],
        [(x0, y0, z1), (x0, y0, z0), (x0, y1, z0), (x0, y1, z1)],
        [(x1, y0, z1), (x0, y0, z1), (x0, y1, z1), (x1, y1, z1)],
        [(x1, y0, z0), (x1, y0, z1), (x1, y1, z1), (x1, y1, z0)],
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        [(x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)],
    ]
    return [(face, [color] * 4) for face, color in zip(faces, colors, strict=True)]


def cluttered_room(seed: int, size: tuple[float, float, float]) -> Scene:
    """A room with a wall of each colour and boxes of random places and corner colours."""
    draw = np.random.default_rng(seed)
    width, height, length = size
    quads = cuboid(
        (-width / 2, 0, -length / 2),
        (width / 2, height, length / 2),
        (FRONT, LEFT, BACK, RIGHT, FLOOR, CEILING),
    )
    for _ in range(25):
        low = draw.uniform((-width / 2, 0, -length / 2), (width / 2 - 0.5, 1.5, length / 2 - 0.5))
        for corners, _color in cuboid(low.tolist(), (low + draw.uniform(0.1, 0.5, 3)).tolist(), [FLOOR] * 6):
            quads.append((corners, draw.integers(0, 256, (4, 3)).tolist()))
    return scene_of(f"cluttered {seed}", quads)


def papered(scene: Scene, seed: int) -> Scene:
    """The scene with random textures of odd sizes, repeated and mirrored, on two thirds of its triangles."""
    draw = np.random.default_rng(seed)
    textures = tuple(draw.integers(0, 256, (*shape, 3)).astype(np.uint8) for shape in ((5, 8), (16, 3), (1, 1)))
    return replace(
        scene,
        name=f"{scene.name}, papered",
        textures=textures,
        uv=draw.uniform(-2.0, 3.0, (len(scene.vertices), 2)).astype(np.float32),
        triangle_textures=draw.choice([-1, 0, 1, 2], len(scene.triangles), p=[0.34, 0.3, 0.3, 0.06]).astype(np.int32),
    )


def make(name: str) -> Renderer:
    """A renderer by its name in MAKERS; skips the test where it needs what is not installed."""
    if name == "warp":
        pytest.importorskip("warp", reason="warp-lang is not installed: pip install 'thinknav[gpu]'")
    return MAKERS[name]()


@pytest.fixture(scope="session")
def make_by_name() -> Callable[[str], Renderer]:
    return make


@pytest.fixture(params=list(MAKERS))
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    """Every renderer in turn, and Embree at every packet width."""
    made = make(request.param)
    yield made
    made.close()


@pytest.fixture(scope="session")
def rooms() -> tuple[Scene, ...]:
    """Two in vertex colours and one with textures."""
    large, long = cluttered_room(0, (6.0, 2.7, 5.0)), cluttered_room(1, (3.0, 2.4, 8.0))
    return large, long, papered(large, seed=2)


@pytest.fixture(scope="session")
def plain_room() -> Scene:
    """4 m wide, 3 m high, 4 m long around the origin: a colour for each side."""
    return scene_of("plain", cuboid((-2, 0, -2), (2, 3, 2), (FRONT, LEFT, BACK, RIGHT, FLOOR, CEILING)))


@pytest.fixture(scope="session")
def wall() -> Scene:
    """2 m ahead, 2 m wide and 2 m high from the floor: red runs from 0 at the left to 200 at the right."""
    corners = [(-1, 0, -2), (1, 0, -2), (1, 2, -2), (-1, 2, -2)]
    return scene_of("wall", [(corners, [(0, 0, 90), (200, 0, 90), (200, 0, 90), (0, 0, 90)])])
