"""The map from above: where things lie on it, and in which colours."""

import numpy as np
import pytest

from thinknav_sim.homes import generate_home
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene
from thinknav_trainer.report.floor_map import WALL_COLOR, colors_from_above, draw_floor_map, draw_path


def slope() -> Scene:
    """One triangle over x, z in 0..1 that goes from black at the corner to red along x and blue along z."""
    return Scene(
        name="slope",
        vertices=np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]], np.float32),
        triangles=np.array([[0, 1, 2]], np.int32),
        colors=np.array([[0, 0, 0], [200, 0, 0], [0, 0, 100]], np.uint8),
        triangle_objects=np.array([-1], np.int32),
    )


def test_colours_run_across_a_triangle() -> None:
    points = np.array([[0, 2, 0], [1, 2, 0], [0.25, 2, 0.5]])
    found = colors_from_above(slope(), points, np.zeros(3, np.int32))
    assert found == pytest.approx(np.array([[0, 0, 0], [200, 0, 0], [50, 0, 50]]))


def test_a_home_from_above_shows_walls_rooms_and_the_path() -> None:
    home = generate_home(3, rooms=2)
    renderer = make_renderer()
    grid = NavigationGrid.from_scene(home, renderer)
    floor_map = draw_floor_map(home, renderer, grid, 0.18)
    pixels = np.asarray(floor_map.image)
    room = home.rooms[0].bounds
    column, row = (int(at) for at in floor_map.pixel((room[0] + room[2]) / 2, room[1] - 0.03))
    outer_wall = pixels[row, column]
    assert tuple(outer_wall) == WALL_COLOR
    start, end = grid.positions(*np.nonzero(grid.navigable))[[0, -1]]
    path = [[*start, 0.0], [*end, 0.0]]
    drawn = np.asarray(draw_path(floor_map, home, "bed", path, [1]))
    changed = np.argwhere((drawn != pixels).any(axis=2))
    for pose in path:
        column, row = (int(at) for at in floor_map.pixel(pose[0], pose[2]))
        assert np.abs(changed - [row, column]).sum(axis=1).min() <= 1
