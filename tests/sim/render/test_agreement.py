"""The rasteriser, Embree and Warp held to Open3D: the same picture from any pose.

Open3D shares no code with them past the arguments.
"""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thinknav_sim.render import Camera, EmbreeRenderer, Open3DRenderer, Renderer
from thinknav_sim.scene import Scene

DEPTH_TOLERANCE_M = 1e-4
# A ray that grazes an edge may fall on either side of it.
EDGE_SHARE = 1e-3
# Number 0 was the known-answer check's.
SCENE_IDS = [1, 2, 3]


@pytest.fixture(scope="module", params=["raster", "embree-4", "embree-8", "embree-16", "warp"])
def drawing(
    request: pytest.FixtureRequest, make_by_name: Callable[[str], Renderer], rooms: tuple[Scene, ...]
) -> Iterator[Renderer]:
    renderer = make_by_name(request.param)
    assert [renderer.add_scene(room) for room in rooms] == SCENE_IDS
    yield renderer
    renderer.close()


@pytest.fixture(scope="module")
def oracle(rooms: tuple[Scene, ...]) -> Iterator[Open3DRenderer]:
    with Open3DRenderer() as renderer:
        assert [renderer.add_scene(room) for room in rooms] == SCENE_IDS
        yield renderer


def random_poses(count: int, seed: int) -> NDArray[np.float64]:
    draw = np.random.default_rng(seed)
    return draw.uniform((-1.4, 0, -2.4, -7), (1.4, 0.5, 2.4, 7), (count, 4))


def assert_same_pictures(
    drawing: Renderer, oracle: Renderer, poses: NDArray[np.float64], camera: Camera, edge_pixels: int
) -> None:
    scene_ids = np.resize(SCENE_IDS, len(poses))
    rgb, depth = drawing.render(scene_ids, poses, camera)
    expected_rgb, expected_depth = oracle.render(scene_ids, poses, camera)
    off = np.abs(depth - expected_depth)[..., 0] > DEPTH_TOLERANCE_M
    off |= (np.abs(rgb.astype(int) - expected_rgb) > 1).any(axis=-1)
    assert off.sum() <= edge_pixels


@pytest.mark.parametrize(("width", "height"), [(128, 128), (64, 48), (33, 17), (5, 131), (3, 2), (1, 1)])
def test_pictures_agree(drawing: Renderer, oracle: Open3DRenderer, width: int, height: int) -> None:
    poses = random_poses(10, seed=width)
    edge_pixels = int(EDGE_SHARE * len(poses) * width * height)
    assert_same_pictures(drawing, oracle, poses, Camera(width, height), edge_pixels)


@settings(deadline=None, max_examples=40)
@given(
    width=st.integers(1, 21),
    height=st.integers(1, 21),
    hfov=st.floats(5, 160),
    elevation=st.floats(0.05, 1.8),
    seed=st.integers(0, 2**32 - 1),
    views=st.integers(1, 5),
)
def test_pictures_agree_whatever_the_camera(
    drawing: Renderer,
    oracle: Open3DRenderer,
    width: int,
    height: int,
    hfov: float,
    elevation: float,
    seed: int,
    views: int,
) -> None:
    camera = Camera(width, height, hfov, elevation)
    assert_same_pictures(drawing, oracle, random_poses(views, seed), camera, edge_pixels=2)


@pytest.mark.parametrize("rays", [1, 16, 1001])
def test_rays_agree(drawing: Renderer, oracle: Open3DRenderer, rays: int) -> None:
    draw = np.random.default_rng(rays)
    # Some start outside the room, and some of those miss it.
    origins = draw.uniform((-6, 0.1, -6), (6, 2, 6), (rays, 3)).astype(np.float32)
    directions = draw.normal(0, 3, (rays, 3)).astype(np.float32)
    hits, expected = drawing.cast(1, origins, directions), oracle.cast(1, origins, directions)
    same = hits.triangle == expected.triangle
    assert (~same).sum() <= 1
    np.testing.assert_allclose(hits.distance[same], expected.distance[same], atol=DEPTH_TOLERANCE_M)
    if rays > 1000:
        assert 100 < (hits.triangle < 0).sum() < 900


def test_every_packet_width_draws_the_same(rooms: tuple[Scene, ...]) -> None:
    poses, camera = random_poses(6, seed=3), Camera(50, 30)
    pictures = []
    for width in (4, 8, 16):
        with EmbreeRenderer(packet_width=width) as renderer:
            assert renderer.packet_width == width
            scenes = [renderer.add_scene(room) for room in rooms]
            pictures.append(renderer.render(np.resize(scenes, 6), poses, camera))
    for rgb, depth in pictures[1:]:
        assert (np.abs(depth - pictures[0][1]) > DEPTH_TOLERANCE_M).mean() <= EDGE_SHARE
        assert (np.abs(rgb.astype(int) - pictures[0][0]) > 1).mean() <= EDGE_SHARE
