"""Walking distances against straight lines and against a way around a wall."""

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.navigation import NavigationGrid, distance_field, distances_at, shortest_path
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene


def at(x: float, z: float) -> NDArray[np.float64]:
    return np.array([[x, 0.0, z]])


def target(grid: NavigationGrid, x: float, z: float) -> NDArray[np.bool_]:
    mask = np.zeros(grid.shape, np.bool_)
    mask[grid.cells(at(x, z))] = True
    return mask


def test_an_empty_room_is_walked_straight(empty_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(empty_room, renderer)
    field = distance_field(grid, target(grid, 2.0, 3.5))
    goal = grid.positions(*np.nonzero(field == 0))[0]
    positions = grid.random_navigable(np.random.default_rng(0), 400)
    straight = np.linalg.norm(positions - goal, axis=1)
    walked = distances_at(grid, field, positions)
    far = straight > 1.0
    np.testing.assert_allclose(walked[far], straight[far], rtol=0.015)
    np.testing.assert_allclose(walked[~far], straight[~far], atol=0.02)


def test_distance_counts_from_the_centres_of_targets(empty_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(empty_room, renderer)
    targets = np.zeros(grid.shape, np.bool_)
    targets[:, 20] = True
    field = distance_field(grid, targets)
    np.testing.assert_allclose(field[60, 20:60], np.arange(40) * grid.cell, atol=1e-4)


def test_a_way_around_a_wall(divided_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(divided_room, renderer)
    field = distance_field(grid, target(grid, 2.5, 2.0))
    start = grid.positions(*grid.cells(at(2.5, 4.0)))[0]
    goal = grid.positions(*np.nonzero(field == 0))[0]
    # Taut around the end of the wall, which the body's radius widens: the corners that it leaves to walk around.
    rows, cols = np.nonzero(~grid.navigable[:, :-15])
    wall = grid.positions(rows, cols)
    wall = wall[(wall[:, 2] > 2.5) & (wall[:, 2] < 3.5) & (wall[:, 0] > 1.0)]
    corner_x = wall[:, 0].max() + grid.cell
    near = np.array([corner_x, 0.0, wall[:, 2].min()])
    far = np.array([corner_x, 0.0, wall[:, 2].max()])
    length = np.linalg.norm(start - far) + np.linalg.norm(far - near) + np.linalg.norm(near - goal)
    assert distances_at(grid, field, start[None])[0] == pytest.approx(length, rel=0.02)
    path = shortest_path(grid, field, start)
    np.testing.assert_allclose(path[0], start)
    np.testing.assert_allclose(path[-1], goal)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(length, rel=0.03)


def test_what_cannot_be_reached_is_infinitely_far(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    grid = NavigationGrid.from_scene(make_room(walls=[(0.0, 0.0, 1.95, 6.0, 2.5, 2.05)]), renderer)
    field = distance_field(grid, target(grid, 3.0, 4.0))
    assert np.isinf(distances_at(grid, field, at(3.0, 1.0))).all()
    assert np.isinf(field[~grid.navigable]).all()
    assert np.isfinite(field[grid.navigable]).all()
    with pytest.raises(ValueError, match=r"no path leads to the goal from x 3\.00, z 1\.00"):
        shortest_path(grid, field, at(3.0, 1.0)[0])


def test_interpolation_leaves_out_what_cannot_be_reached(empty_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(empty_room, renderer)
    field = distance_field(grid, target(grid, 3.0, 3.0))
    rows, cols = np.nonzero(grid.navigable)
    rim = grid.positions(rows[:1], cols[:1])
    # The corner cell's own value, though three of the four cells around the point are walls.
    towards_corner = rim - [[0.02, 0.0, 0.02]]
    assert distances_at(grid, field, towards_corner)[0] == pytest.approx(field[rows[0], cols[0]])


def test_targets_everywhere_and_nowhere(empty_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(empty_room, renderer)
    assert (distance_field(grid, grid.navigable)[grid.navigable] == 0).all()
    assert np.isinf(distance_field(grid, np.zeros(grid.shape, np.bool_))).all()
