"""What may go wrong when triangles are drawn: cracks, what reaches behind the camera, and what has no area."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thinknav_sim.render import Camera, EmbreeRenderer, Open3DRenderer, RasterRenderer, raster, raster_setup
from thinknav_sim.render.picture_memory import PictureMemory
from thinknav_sim.render.raster_clusters import BLOCK, CLUSTER, cluster
from thinknav_sim.render.raster_shading import write_plane
from thinknav_sim.scene import Scene

SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def oracle() -> Iterator[Open3DRenderer]:
    with Open3DRenderer() as renderer:
        yield renderer


@pytest.fixture(scope="module")
def drawing() -> Iterator[RasterRenderer]:
    with RasterRenderer(EmbreeRenderer()) as renderer:
        yield renderer


def scene_of_corners(corners: NDArray[np.float64], seed: int) -> Scene:
    """A scene of triangles (T, 3, 3), of one random colour each."""
    colors = np.random.default_rng(seed).integers(0, 256, (len(corners), 3)).astype(np.uint8)
    return Scene(
        name=f"soup {seed}",
        vertices=corners.reshape(-1, 3).astype(np.float32),
        triangles=np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3),
        colors=np.repeat(colors, 3, axis=0),
        triangle_objects=np.full(len(corners), -1, np.int32),
    )


def cave(seed: int, rings: int = 9, sides: int = 11) -> Scene:
    """A closed, crumpled ball around the origin; all of it is seen from the origin, and every edge is shared."""
    draw = np.random.default_rng(seed)
    up, round_ = np.linspace(-np.pi / 2, np.pi / 2, rings), np.linspace(0, 2 * np.pi, sides, endpoint=False)
    radii = draw.uniform(0.2, 8.0, (rings, sides))
    radii[0], radii[-1] = radii[0, 0], radii[-1, 0]
    flat = np.cos(up)[:, None] * radii
    flat[0] = flat[-1] = 0
    points = np.stack([flat * np.cos(round_), np.sin(up)[:, None] * radii, flat * np.sin(round_)], axis=-1)
    beside = np.roll(points, -1, axis=1)
    lower = np.stack([points[:-1], beside[:-1], beside[1:]], axis=2)
    upper = np.stack([points[:-1], beside[1:], points[1:]], axis=2)
    return scene_of_corners(np.concatenate([lower, upper]).reshape(-1, 3, 3), seed)


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, heading=st.floats(-7, 7), width=st.integers(1, 40), hfov=st.floats(5, 160))
def test_no_cracks(drawing: RasterRenderer, seed: int, heading: float, width: int, hfov: float) -> None:
    scene = drawing.add_scene(cave(seed))
    camera = Camera(width, 31, hfov, elevation=1e-3)
    _, depth = drawing.render(np.array([scene]), np.array([(0.0, -1e-3, 0.0, heading)]), camera)
    drawing.remove_scene(scene)
    assert (depth > 0).all()


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, heading=st.floats(-7, 7), size=st.floats(0.01, 20.0), hfov=st.floats(20, 140))
def test_any_triangles_look_as_rays_see_them(
    drawing: RasterRenderer, oracle: Open3DRenderer, seed: int, heading: float, size: float, hfov: float
) -> None:
    """All around the camera, most of the large ones reaching behind it; some without an area."""
    draw = np.random.default_rng(seed)
    corners = draw.uniform(-4, 4, (90, 1, 3)) + draw.normal(0, size, (90, 3, 3))
    corners[::10, 2] = corners[::10, 1]
    corners[5::10] = corners[5::10, :1]
    scene = scene_of_corners(corners, seed)
    ids = drawing.add_scene(scene), oracle.add_scene(scene)
    pose, camera = np.array([(0.1, -0.7, 0.2, heading)]), Camera(37, 29, hfov)
    rgb, depth = drawing.render(np.array([ids[0]]), pose, camera)
    expected_rgb, expected_depth = oracle.render(np.array([ids[1]]), pose, camera)
    drawing.remove_scene(ids[0])
    oracle.remove_scene(ids[1])
    off = np.abs(depth - expected_depth)[..., 0] > 1e-4 * np.maximum(1, expected_depth[..., 0])
    off |= (np.abs(rgb.astype(int) - expected_rgb) > 1).any(axis=-1)
    assert off.sum() <= 4


@pytest.mark.parametrize("turned", [False, True])
def test_pixels_on_an_edge_belong_to_someone(drawing: RasterRenderer, turned: bool) -> None:
    """Squares whose edges, diagonals too, run through the very middles of pixels."""
    places = np.arange(-8, 8) / 4
    x, y = (axis.ravel() for axis in np.meshgrid(places, places))
    square = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]) / 4
    flat = np.stack([x, y], axis=-1)[:, None, None] + square
    corners = np.concatenate([flat, np.full((*flat.shape[:-1], 1), -1.0)], axis=-1).reshape(-1, 3, 3)
    scene = drawing.add_scene(scene_of_corners(corners[:, ::-1] if turned else corners, 0))
    # The middle pixel looks straight ahead, and the next ones a quarter of a metre beside it at a metre.
    camera = Camera(11, 11, hfov=float(2 * np.degrees(np.arctan(11 / 8))), elevation=1.0)
    _, depth = drawing.render(np.array([scene]), np.array([(0.0, -1.0, 0.0, 0.0)]), camera)
    np.testing.assert_allclose(depth, 1.0, atol=1e-6)


def test_what_is_hidden_is_hidden_however_much_there_is(drawing: RasterRenderer, oracle: Open3DRenderer) -> None:
    """More clusters than are drawn between two looks at what is covered, most of them behind a wall with a hole."""
    draw = np.random.default_rng(0)
    wall = np.array([[(-9, -9, -1), (9, -9, -1), (-0.3, 0.2, -1)], [(9, -9, -1), (9, 9, -1), (0.3, 0.2, -1)]])
    behind = draw.uniform((-9, -9, -12), (9, 9, -1.5), (3000, 1, 3)) + draw.normal(0, 0.3, (3000, 3, 3))
    scene = scene_of_corners(np.concatenate([behind, wall]), 0)
    poses, camera = np.array([(0.0, 0.0, 0.0, 0.0), (0.5, 0.0, -0.5, 0.3)]), Camera(100, 75)
    rgb, depth = drawing.render(np.full(2, drawing.add_scene(scene)), poses, camera)
    expected_rgb, expected_depth = oracle.render(np.full(2, oracle.add_scene(scene)), poses, camera)
    assert (np.abs(depth - expected_depth) > 1e-4).mean() < 1e-3
    assert (np.abs(rgb.astype(int) - expected_rgb) > 1).mean() < 1e-3


def test_large_scenes_are_drawn_by_rays(
    monkeypatch: pytest.MonkeyPatch, drawing: RasterRenderer, rooms: tuple[Scene, ...]
) -> None:
    poses, camera = np.random.default_rng(0).uniform(-1, 1, (6, 4)), Camera(20, 12)
    usual = drawing.render(np.resize([drawing.add_scene(room) for room in rooms], 6), poses, camera)
    monkeypatch.setattr(raster, "MAX_TRIANGLES", len(rooms[0].triangles) - 1)
    long_room = Scene(
        rooms[1].name, rooms[1].vertices, rooms[1].triangles[:300], rooms[1].colors, rooms[1].triangle_objects[:300]
    )
    with RasterRenderer(EmbreeRenderer()) as renderer:
        ids = [renderer.add_scene(room) for room in (rooms[0], long_room, rooms[2])]
        assert [renderer._scenes[scene_id].is_large for scene_id in ids] == [True, False, True]
        rgb, depth = renderer.render(np.resize(ids, 6), poses, camera)
        only = renderer.render(np.array([ids[0], ids[2]]), poses[[0, 2]], camera)
    shown = [0, 2, 3, 5]
    assert (np.abs(depth[shown] - usual[1][shown]) > 1e-4).mean() < 5e-3
    np.testing.assert_array_equal(only[0], rgb[[0, 2]])
    np.testing.assert_array_equal(only[1], depth[[0, 2]])
    assert (depth[[1, 4]] > 0).any()


def test_clusters_hold_every_triangle_once(rooms: tuple[Scene, ...]) -> None:
    for room in rooms:
        clusters = cluster(room)
        corners = clusters.corners.transpose(0, 2, 1).reshape(-1, 3, 3)
        filled = np.abs(corners).sum(axis=(1, 2)) > 0
        expected = room.vertices[room.triangles]
        assert filled.sum() == len(expected)
        np.testing.assert_array_equal(
            np.sort(corners[filled].reshape(-1, 9), axis=0), np.sort(expected.reshape(-1, 9), axis=0)
        )
        owner = np.repeat(np.arange(len(clusters.boxes)), CLUSTER)[filled]
        low, high = clusters.boxes[owner, :3], clusters.boxes[owner, 3:]
        block = np.arange(len(clusters.boxes)) // BLOCK
        assert (clusters.blocks[block, :3] <= clusters.boxes[:, :3]).all()
        assert (clusters.blocks[block, 3:] >= clusters.boxes[:, 3:]).all()
        assert ((corners[filled] >= low[:, None]) & (corners[filled] <= high[:, None])).all()


def test_blocks_of_clusters_lose_nothing_in_sight(drawing: RasterRenderer, oracle: Open3DRenderer) -> None:
    draw = np.random.default_rng(5)
    corners = draw.uniform(-4, 4, (6000, 1, 3)) + draw.uniform(-0.15, 0.15, (6000, 3, 3))
    scene = scene_of_corners(corners, 5)
    assert len(cluster(scene).blocks) > 8
    poses = np.column_stack([draw.uniform(-3, 3, (12, 3)), np.linspace(-3, 3, 12)])
    camera = Camera(48, 40, elevation=1e-3)
    pictures = []
    for renderer in (drawing, oracle):
        scene_id = renderer.add_scene(scene)
        pictures.append(renderer.render(np.full(12, scene_id), poses, camera))
        renderer.remove_scene(scene_id)
    off = np.abs(pictures[0][1] - pictures[1][1]) > 1e-4
    assert off.mean() < 2e-3
    assert (pictures[1][1] > 0).mean() > 0.2


def test_what_memory_held_before_slows_no_textures() -> None:
    """Denormal numbers left in a plane's third channel made every textured pixel ten times as slow."""
    prepared, plane = np.ones((raster_setup.ROWS, CLUSTER)), np.full(9, 1e-40, np.float32)
    write_plane(prepared, 0, np.ones(6, np.float32), plane)
    assert plane.tolist() == [3, 3, 0] * 3


def test_memory_is_used_again_once_nobody_looks_at_it() -> None:
    memory = PictureMemory()
    first = memory.empty((2, 3, 4), np.uint8)
    other = memory.empty((2, 3), np.float32)
    first[:], other[:] = 7, 1.5
    address, look = first.ctypes.data, first[1, :, ::2]
    del first
    between = memory.empty((24,), np.uint8)
    assert between.ctypes.data != address
    assert (look == 7).all()
    del look
    again = memory.empty((4, 6), np.uint8)
    assert again.ctypes.data == address
    assert again.flags.c_contiguous
    assert again.flags.writeable
    assert (other == 1.5).all()
