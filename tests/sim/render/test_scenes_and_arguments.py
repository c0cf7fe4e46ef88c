"""Scenes come and go, and bad arguments are named, alike in every renderer."""

import contextlib
import gc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest

from thinknav_sim.render import Camera, EmbreeRenderer, Renderer
from thinknav_sim.scene import Scene

CAMERA = Camera(width=8, height=8)


def test_a_removed_scene_is_gone_and_the_others_stay(renderer: Renderer, plain_room: Scene, wall: Scene) -> None:
    room, board = renderer.add_scene(plain_room), renderer.add_scene(wall)
    before = renderer.render(np.array([board]), np.zeros((1, 4)), CAMERA)
    renderer.remove_scene(room)
    with pytest.raises(KeyError, match=f"no scene {room}; it has: {board}"):
        renderer.render(np.array([board, room]), np.zeros((2, 4)), CAMERA)
    with pytest.raises(KeyError, match=f"no scene {room}"):
        renderer.cast(room, np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    with pytest.raises(KeyError, match=f"no scene {room}"):
        renderer.remove_scene(room)
    again = renderer.add_scene(plain_room)
    assert again not in (room, board)
    after = renderer.render(np.array([board]), np.zeros((1, 4)), CAMERA)
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_array_equal(after[1], before[1])


def test_a_closed_renderer_says_so(renderer: Renderer, wall: Scene) -> None:
    scene = renderer.add_scene(wall)
    renderer.close()
    renderer.close()
    with pytest.raises(RuntimeError, match="the renderer is closed"):
        renderer.add_scene(wall)
    with pytest.raises(KeyError, match="it has: none"):
        renderer.render(np.array([scene]), np.zeros((1, 4)), CAMERA)


def test_a_removed_scene_frees_what_embree_built(wall: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    with EmbreeRenderer() as renderer:
        scene = renderer.add_scene(wall)
        renderer.cast(scene, np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
        built = renderer._scenes[scene]
        releases = [built.picture._release, built.watertight._release]
        del built
        assert all(release.alive for release in releases)
        renderer.remove_scene(scene)
        assert not any(release.alive for release in releases)


def test_a_forgotten_renderer_frees_its_device(wall: Scene) -> None:
    renderer = EmbreeRenderer()
    scene = renderer.add_scene(wall)
    picture = renderer._scenes[scene].picture._release
    device = renderer._device._release
    assert picture.alive
    assert device.alive
    del renderer
    gc.collect()
    assert not picture.alive
    assert not device.alive


def test_the_scene_may_be_forgotten_by_its_maker(renderer: Renderer) -> None:
    """The renderer keeps what it needs: drawing after the arrays are gone gives the same picture."""
    draw = np.random.default_rng(0)
    arrays: list[Any] = [
        draw.uniform(-1, 1, (3000, 3)).astype(np.float32),
        np.arange(3000, dtype=np.int32).reshape(1000, 3),
        draw.integers(0, 256, (3000, 3)).astype(np.uint8),
        np.full(1000, -1, np.int32),
    ]
    scene = renderer.add_scene(Scene("dust", *arrays))
    pose = np.array([(0.0, -0.88, 2.0, 0.0)])
    before, _ = renderer.render(np.array([scene]), pose, CAMERA)
    del arrays
    gc.collect()
    others = [np.full((3000, 3), 7.0, np.float32) for _ in range(20)]
    after, _ = renderer.render(np.array([scene]), pose, CAMERA)
    assert len(others) == 20
    assert before.any()
    np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize(
    ("scene_ids", "poses", "message"),
    [
        (np.zeros((1, 1), np.int64), np.zeros((1, 4)), r"scene_ids must be integers of shape \(N,\)"),
        (np.zeros(1), np.zeros((1, 4)), "scene_ids .* not float64"),
        (np.zeros(2, np.int64), np.zeros((1, 4)), r"poses must be floats of shape \(2, 4\).* shape \(1, 4\)"),
        (np.zeros(1, np.int64), np.zeros((1, 3)), r"shape \(1, 3\)"),
        (np.zeros(1, np.int64), np.zeros((1, 4), np.int64), "poses .* not int64"),
        (
            np.zeros(2, np.int64),
            np.array([[0.0] * 4, [0.0, 0.0, 0.0, np.nan]]),
            "pose of view 1 is not finite",
        ),
        (np.zeros(1, np.int64), np.array([[np.inf, 0.0, 0.0, 0.0]]), "pose of view 0 is not finite"),
    ],
)
def test_bad_views_are_named(renderer: Renderer, wall: Scene, scene_ids: Any, poses: Any, message: str) -> None:
    renderer.add_scene(wall)
    with pytest.raises(ValueError, match=message):
        renderer.render(scene_ids, poses, CAMERA)


def test_arrays_of_any_layout_are_taken(renderer: Renderer, plain_room: Scene) -> None:
    scene = renderer.add_scene(plain_room)
    poses = np.random.default_rng(0).uniform(-1, 1, (4, 6))
    strided = poses[:, ::-1][:, 1:5]
    strided.flags.writeable = False
    ids = np.full(4, scene, np.int32)
    rgb, depth = renderer.render(ids.astype(np.int64), strided, CAMERA)
    plain_rgb, plain_depth = renderer.render(ids, np.ascontiguousarray(strided), CAMERA)  # type: ignore[arg-type]
    np.testing.assert_array_equal(rgb, plain_rgb)
    np.testing.assert_array_equal(depth, plain_depth)


def test_a_scene_of_any_layout_is_taken(renderer: Renderer, plain_room: Scene) -> None:
    other = replace(plain_room, vertices=np.asfortranarray(plain_room.vertices))
    plain, strided = renderer.add_scene(plain_room), renderer.add_scene(other)
    ways = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    origins = np.tile(plain_room.bounds.center.astype(np.float32), (50, 1))
    np.testing.assert_array_equal(
        renderer.cast(strided, origins, ways).distance, renderer.cast(plain, origins, ways).distance
    )


@pytest.mark.parametrize("width", [1, 3, 32, -8])
def test_an_odd_packet_width_is_refused(width: int) -> None:
    with pytest.raises(ValueError, match=rf"one of \(16, 8, 4\), or 0 for the best, not {width}"):
        EmbreeRenderer(packet_width=width)


@pytest.mark.parametrize("name", ["raster", "embree"])
@pytest.mark.parametrize("views", [1, 5])
def test_any_number_of_threads_draws_the_same(
    make_by_name: Callable[[str], Renderer], name: str, views: int, rooms: tuple[Scene, Scene]
) -> None:
    poses = np.random.default_rng(0).uniform(-1, 1, (views, 4))
    pictures = []
    all_threads = numba.get_num_threads()
    with contextlib.closing(make_by_name(name)) as renderer:
        scene = renderer.add_scene(rooms[0])
        try:
            for threads in range(1, all_threads + 1):
                numba.set_num_threads(threads)
                pictures.append(renderer.render(np.full(views, scene), poses, Camera(31, 23)))
        finally:
            numba.set_num_threads(all_threads)
    for rgb, depth in pictures:
        np.testing.assert_array_equal(rgb, pictures[0][0])
        np.testing.assert_array_equal(depth, pictures[0][1])
