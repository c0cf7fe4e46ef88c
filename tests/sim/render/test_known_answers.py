"""Pictures that can be worked out on paper, from every renderer: a wrong sign or layout shows."""

import math

import numpy as np
import pytest

from thinknav_sim.render import NOTHING_DEPTH, Camera, Renderer
from thinknav_sim.scene import Scene

FRONT, LEFT, BACK, RIGHT, FLOOR, CEILING = (
    [200, 0, 0],
    [0, 200, 0],
    [200, 200, 0],
    [0, 0, 200],
    [40, 40, 40],
    [240, 240, 240],
)


def test_depth_is_along_the_optical_axis(renderer: Renderer, plain_room: Scene) -> None:
    scene = renderer.add_scene(plain_room)
    camera = Camera(width=30, height=22, hfov=60.0)
    rgb, depth = renderer.render(np.array([scene]), np.array([(0.5, 0.0, 0.0, 0.0)]), camera)
    assert rgb.shape == (1, 22, 30, 3)
    assert rgb.dtype == np.uint8
    assert depth.shape == (1, 22, 30, 1)
    assert depth.dtype == np.float32
    on_the_wall = (rgb[0] == FRONT).all(axis=-1)
    assert on_the_wall.mean() > 0.9
    np.testing.assert_allclose(depth[0, ..., 0][on_the_wall], 2.0, atol=1e-5)


def test_a_depth_range_reads_from_0_to_1(renderer: Renderer, plain_room: Scene) -> None:
    """The agent stands 1, 2 and 3 m before a wall, and then outside of the room with its back to it."""
    scene = renderer.add_scene(plain_room)
    poses = np.array([(0, 0, -1, 0), (0, 0, 0, 0), (0, 0, 1, 0), (0, 0, -3, 0)], np.float64)
    for depth_range, expected in (((1.5, 2.5), [0, 0.5, 1, 0]), ((0.1, 10.0), [0.9 / 9.9, 1.9 / 9.9, 2.9 / 9.9, 0])):
        camera = Camera(width=5, height=5, hfov=20.0, depth_range=depth_range)
        _, depth = renderer.render(np.full(4, scene), poses, camera)
        assert depth.dtype == np.float32
        np.testing.assert_allclose(depth, np.broadcast_to(np.reshape(expected, (4, 1, 1, 1)), depth.shape), atol=1e-5)
        assert 0 <= depth.min() <= depth.max() <= 1


@pytest.mark.parametrize(
    "depth_range", [(2.0, 2.0), (1.0, 1.00000001), (-1.0, 2.0), (0.5, math.inf), (0.5, 1e39), (math.nan, 1.0)]
)
def test_a_depth_range_is_checked(depth_range: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="a depth range goes from"):
        Camera(depth_range=depth_range)


@pytest.mark.parametrize(("turns_left", "color"), [(0, FRONT), (1, LEFT), (2, BACK), (3, RIGHT), (-1, RIGHT)])
def test_turning_left_adds_to_the_heading(
    renderer: Renderer, plain_room: Scene, turns_left: int, color: list[int]
) -> None:
    scene = renderer.add_scene(plain_room)
    pose = (0.0, 0.0, 0.0, turns_left * math.pi / 2)
    rgb, depth = renderer.render(np.array([scene]), np.array([pose]), Camera(width=9, height=9, hfov=40.0))
    assert (rgb == color).all()
    np.testing.assert_allclose(depth, 2.0, atol=1e-5)


def test_a_step_forward_brings_the_wall_nearer(renderer: Renderer, plain_room: Scene) -> None:
    scene = renderer.add_scene(plain_room)
    headings = np.linspace(-3, 3, 7)
    forward = np.stack([-np.sin(headings), 0 * headings, -np.cos(headings)], axis=1)
    still = np.column_stack([np.zeros((7, 3)), headings])
    stepped = np.column_stack([forward * 0.25, headings])
    camera = Camera(width=1, height=1, hfov=1.0)
    _, far = renderer.render(np.full(7, scene), still, camera)
    _, near = renderer.render(np.full(7, scene), stepped, camera)
    np.testing.assert_allclose(far - near, 0.25, atol=1e-5)


def test_up_is_up_and_left_is_left(renderer: Renderer, plain_room: Scene) -> None:
    scene = renderer.add_scene(plain_room)
    camera = Camera(width=64, height=64, hfov=120.0, elevation=1.5)
    rgb, _ = renderer.render(np.array([scene]), np.zeros((1, 4)), camera)
    assert rgb[0, 0, 32].tolist() == CEILING
    assert rgb[0, 63, 32].tolist() == FLOOR
    assert rgb[0, 32, 0].tolist() == LEFT
    assert rgb[0, 32, 63].tolist() == RIGHT
    assert rgb[0, 32, 32].tolist() == FRONT


def test_field_of_view_and_elevation(renderer: Renderer, wall: Scene) -> None:
    """With 90 degrees over 64 columns, a metre at 2 m is 16 pixels both ways."""
    scene = renderer.add_scene(wall)
    camera = Camera(width=64, height=80, hfov=90.0, elevation=1.5)
    _, depth = renderer.render(np.array([scene]), np.zeros((1, 4)), camera)
    expected = np.full((80, 64), NOTHING_DEPTH)
    expected[40 - 8 : 40 + 24, 32 - 16 : 32 + 16] = 2.0
    np.testing.assert_allclose(depth[0, ..., 0], expected, atol=1e-5)


def test_colors_run_between_corners(renderer: Renderer, wall: Scene) -> None:
    scene = renderer.add_scene(wall)
    camera = Camera(width=64, height=16, hfov=90.0, elevation=1.01)
    rgb, _ = renderer.render(np.array([scene]), np.zeros((1, 4)), camera)
    x = (np.arange(16, 48) + 0.5 - 32) / 16
    red = np.broadcast_to((x + 1) * 100, (16, 32))
    np.testing.assert_allclose(rgb[0, :, 16:48, 0], red, atol=0.51)
    assert (rgb[0, :, 16:48, 1] == 0).all()
    assert (rgb[0, :, 16:48, 2] == 90).all()


def test_where_there_is_nothing(renderer: Renderer, wall: Scene) -> None:
    scene = renderer.add_scene(wall)
    behind = np.array([(0.0, 0.0, 0.0, math.pi)])
    rgb, depth = renderer.render(np.array([scene]), behind, Camera(width=10, height=6))
    assert not rgb.any()
    assert (depth == NOTHING_DEPTH).all()


def test_each_view_shows_its_own_scene(renderer: Renderer, plain_room: Scene, wall: Scene) -> None:
    room, board = renderer.add_scene(plain_room), renderer.add_scene(wall)
    camera = Camera(width=6, height=6, hfov=20.0)
    rgb, _ = renderer.render(np.array([board, room, board]), np.zeros((3, 4)), camera)
    assert (rgb[1] == FRONT).all()
    assert (rgb[[0, 2], ..., 2] == 90).all()


def test_no_views(renderer: Renderer) -> None:
    rgb, depth = renderer.render(np.empty(0, np.int64), np.empty((0, 4)), Camera(width=6, height=4))
    assert rgb.shape == (0, 4, 6, 3)
    assert depth.shape == (0, 4, 6, 1)
