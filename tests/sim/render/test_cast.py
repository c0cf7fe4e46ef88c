"""Rays: distances in units of the direction, triangle numbers, misses, and no way through a closed wall."""

import numpy as np
import pytest

from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene


def test_distance_is_in_units_of_the_direction(renderer: Renderer, plain_room: Scene) -> None:
    scene = renderer.add_scene(plain_room)
    origins = np.tile(np.array([0.3, 1.1, 0.2], np.float32), (4, 1))
    directions = np.array([(0, 0, -1), (0, 0, -10), (-0.5, 0, 0), (0, -1, 0)], np.float32)
    hits = renderer.cast(scene, origins, directions)
    np.testing.assert_allclose(hits.distance, [2.2, 0.22, 4.6, 1.1], rtol=1e-5)
    assert hits.distance.dtype == np.float32
    assert hits.triangle.dtype == np.int32


def test_hits_name_the_triangle(renderer: Renderer, plain_room: Scene) -> None:
    """Aim at the middle of every triangle of the room: each is seen from inside."""
    scene = renderer.add_scene(plain_room)
    middles = plain_room.vertices[plain_room.triangles].mean(axis=1)
    origins = np.broadcast_to(np.array([0.1, 1.4, -0.2], np.float32), middles.shape)
    hits = renderer.cast(scene, origins, middles - origins)
    assert hits.triangle.tolist() == list(range(len(plain_room.triangles)))
    np.testing.assert_allclose(hits.distance, 1.0, rtol=1e-5)


def test_misses(renderer: Renderer, wall: Scene) -> None:
    scene = renderer.add_scene(wall)
    directions = np.array([(0, 0, 1), (0, 0, -1), (5, 0, -1)], np.float32)
    hits = renderer.cast(scene, np.full((3, 3), (0, 0.7, 0), np.float32), directions)
    assert hits.triangle.tolist() == [-1, 0, -1]
    assert np.isposinf(hits.distance[[0, 2]]).all()


def test_a_wall_behind_is_not_met(renderer: Renderer, wall: Scene) -> None:
    scene = renderer.add_scene(wall)
    hits = renderer.cast(scene, np.array([(0, 1, -3)], np.float32), np.array([(0, 0, -1)], np.float32))
    assert hits.triangle.tolist() == [-1]


def test_no_rays(renderer: Renderer, wall: Scene) -> None:
    hits = renderer.cast(renderer.add_scene(wall), np.empty((0, 3), np.float32), np.empty((0, 3), np.float32))
    assert hits.distance.shape == (0,)
    assert hits.triangle.shape == (0,)


def test_no_ray_slips_through_an_edge(renderer: Renderer, plain_room: Scene) -> None:
    """Aim at points on the very edges of a closed room, corners included, from many places within."""
    scene = renderer.add_scene(plain_room)
    draw = np.random.default_rng(0)
    count = 20_000
    corners = plain_room.vertices[plain_room.triangles[draw.integers(0, len(plain_room.triangles), count)]]
    share = draw.choice([0.0, 0.25, 0.5, draw.random()], (count, 1)).astype(np.float32)
    targets = corners[:, 0] * share + corners[:, 1] * (1 - share)
    origins = draw.uniform((-1.9, 0.1, -1.9), (1.9, 2.9, 1.9), (count, 3)).astype(np.float32)
    hits = renderer.cast(scene, origins, targets - origins)
    assert (hits.triangle >= 0).all()
    np.testing.assert_allclose(hits.distance, 1.0, atol=1e-3)


@pytest.mark.parametrize(
    ("origins", "directions", "message"),
    [
        (np.zeros((2, 3), np.float32), np.ones((3, 3), np.float32), "2 origins do not go with 3 directions"),
        (np.zeros(3, np.float32), np.ones((1, 3), np.float32), r"origins must be floats of shape \(R, 3\)"),
        (np.zeros((1, 3), np.float32), np.ones((1, 2), np.float32), r"directions .* shape \(1, 2\)"),
        (np.zeros((1, 3), np.int64), np.ones((1, 3), np.float32), "origins .* not int64"),
        (
            np.zeros((2, 3), np.float32),
            np.eye(2, 3, 1, np.float32) * np.nan,
            "directions of ray 0 are not fin",
        ),
        (np.full((1, 3), np.inf, np.float32), np.ones((1, 3), np.float32), "origins of ray 0 are not finite"),
        (np.full((1, 3), 1e39), np.ones((1, 3), np.float32), "origins of ray 0 are not finite"),
        (np.zeros((2, 3), np.float32), np.array([(0, 0, 1), (0, 0, 0)], np.float32), "ray 1 .* zero length"),
    ],
)
def test_bad_rays_are_named(
    renderer: Renderer,
    wall: Scene,
    origins: np.ndarray[tuple[int, ...], np.dtype[np.float32]],
    directions: np.ndarray[tuple[int, ...], np.dtype[np.float32]],
    message: str,
) -> None:
    scene = renderer.add_scene(wall)
    with pytest.raises(ValueError, match=message):
        renderer.cast(scene, origins, directions)
