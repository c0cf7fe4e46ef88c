"""Floors that are not level: stairs, ramps, holes, storeys, furniture; and where level homes stay as they were."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.sim.conftest import BoxCorners, MakeRoom, build_room
from thinknav_sim.homes import generate_home
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.scans.floors import find_floors
from thinknav_sim.scene import Scene, SceneError


def scan(walls: Sequence[BoxCorners] = (), size: tuple[float, float] = (6.0, 6.0)) -> Scene:
    return replace(build_room(size, walls), level_floors=False)


def patches(rectangles: Sequence[tuple[tuple[float, float, float], ...]]) -> Scene:
    """Rectangles, each by three of its corners; the fourth completes it."""
    corners = [np.array([a, b, np.array(b) + np.array(c) - np.array(a), c]) for a, b, c in rectangles]
    triangles = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * i for i in range(len(corners))])
    vertices = np.concatenate(corners).astype(np.float32)
    return Scene(
        name="patches",
        vertices=vertices,
        triangles=triangles.astype(np.int32),
        colors=np.full((len(vertices), 3), 128, np.uint8),
        triangle_objects=np.full(len(triangles), -1, np.int32),
        level_floors=False,
    )


def level(x0: float, z0: float, x1: float, z1: float, y: float = 0.0) -> tuple[tuple[float, float, float], ...]:
    return (x0, y, z0), (x1, y, z0), (x0, y, z1)


def stands(grid: NavigationGrid, *places: tuple[float, float]) -> list[bool]:
    return [bool(stood) for stood in grid.is_navigable(np.array([[x, 0.0, z] for x, z in places]))]


def height(grid: NavigationGrid, x: float, z: float) -> float:
    rows, cols = grid.cells(np.array([[x, 0.0, z]]))
    return float(grid.floor[rows[0], cols[0]])


def test_a_level_room_is_the_same_either_way(make_room: MakeRoom, renderer: Renderer) -> None:
    table = (2.0, 0.7, 2.0, 3.0, 0.75, 3.0)
    room = make_room(walls=[(0.0, 0.0, 2.95, 5.0, 2.5, 3.05), table])
    flat = NavigationGrid.from_scene(room, renderer)
    followed = NavigationGrid.from_scene(replace(room, level_floors=False), renderer)
    # Where walls stand exactly between two cells, both are blocked in scans.
    assert (flat.navigable != followed.navigable).mean() < 0.02
    assert (followed.navigable <= flat.navigable).all()


def test_homes_are_level() -> None:
    assert generate_home(3).level_floors


@pytest.mark.parametrize(("rise", "climbs"), [(0.1, True), (0.2, True), (0.26, False), (0.4, False)])
def test_a_platform_is_reached_over_a_step(renderer: Renderer, rise: float, climbs: bool) -> None:
    grid = NavigationGrid.from_scene(scan([(3.0, 0.0, 0.0, 6.0, rise, 6.0)]), renderer)
    assert stands(grid, (1.5, 3.0), (4.5, 3.0)) == [True, climbs]
    if climbs:
        assert height(grid, 4.5, 3.0) == pytest.approx(rise, abs=1e-3)
        # And one walks over its edge.
        assert stands(grid, *((x, 3.0) for x in np.arange(1.5, 4.5, 0.05))) == [True] * 60


def test_stairs_lead_up_over_the_space_below_them(renderer: Renderer) -> None:
    """One storey's stairs: each step is a box on the floor, and in the high ones there is room to stand."""
    steps = [(1.0 + 0.28 * i, 0.0, 2.0, 1.28 + 0.28 * i, 0.2 * (i + 1), 4.0) for i in range(7)]
    grid = NavigationGrid.from_scene(scan([*steps, (2.96, 0.0, 2.0, 6.0, 1.6, 4.0)]), renderer)
    way = [(x, 3.0) for x in np.arange(0.5, 4.6, 0.05)]
    assert stands(grid, *way) == [True] * len(way)
    assert height(grid, 4.6, 3.0) == pytest.approx(1.6, abs=1e-3)


@pytest.mark.parametrize("tread", [0.25, 0.3])
def test_stairs_are_climbed(renderer: Renderer, tread: float) -> None:
    steps = [(2.0 + i * tread, 0.0, 2.0, 6.0, 0.2 * (i + 1), 4.0) for i in range(5)]
    grid = NavigationGrid.from_scene(scan(steps), renderer)
    top = 2.0 + 5 * tread + 0.3
    assert stands(grid, *((x, 3.0) for x in np.arange(1.0, top, 0.05))) == [True] * len(np.arange(1.0, top, 0.05))
    assert height(grid, top, 3.0) == pytest.approx(1.0, abs=1e-3)
    # The side of the stairs is an edge: nobody walks off it, nor up from below.
    assert stands(grid, (top, 3.95), (top, 4.1)) == [False, False]
    assert stands(grid, (1.0, 5.0)) == [True]


def test_a_ramp_is_walked_and_a_slide_is_not(renderer: Renderer) -> None:
    for rise, walked in [(0.8, True), (3.5, False)]:
        ramp = ((2.0, 0.0, 0.0), (4.0, rise, 0.0), (2.0, 0.0, 4.0))
        grid = NavigationGrid.from_scene(patches([level(0, 0, 2, 4), ramp, level(4, 0, 6, 4, rise)]), renderer)
        assert stands(grid, (1.0, 2.0), (3.0, 2.0), (5.0, 2.0)) == [True, walked, walked]


def test_furniture_is_not_climbed(renderer: Renderer) -> None:
    stool_by_bed = [(2.0, 0.0, 2.0, 2.3, 0.3, 4.0), (2.3, 0.0, 2.0, 4.0, 0.55, 4.0)]
    grid = NavigationGrid.from_scene(scan(stool_by_bed), renderer)
    assert stands(grid, (3.0, 3.0), (2.15, 3.0), (1.0, 1.0)) == [False, False, True]


def test_a_wall_without_thickness_blocks_wherever_it_stands(renderer: Renderer) -> None:
    for x in np.arange(5.0, 8.0, 0.25):  # binary fractions, where two cells meet
        wall = ((x, 0.0, 0.0), (x, 0.0, 4.0), (x, 2.0, 0.0))
        grid = NavigationGrid.from_scene(patches([level(0, 0, 9, 4), wall]), renderer)
        assert stands(grid, (x - 0.01, 2.0), (x + 0.01, 2.0)) == [False, False]
        assert grid.labels.max() == 2


def test_small_holes_are_floor_and_pits_are_not(renderer: Renderer) -> None:
    def with_hole(width: float, pit: float | None) -> NavigationGrid:
        low, high = 2.0 - width / 2, 2.0 + width / 2
        floor = [level(0, 0, low, 4), level(high, 0, 4, 4), level(low, 0, high, low), level(low, high, high, 4)]
        if pit is not None:
            floor.append(level(low, low, high, high, -pit))
        return NavigationGrid.from_scene(patches(floor), renderer)

    assert stands(with_hole(0.3, None), (2.0, 2.0)) == [True]
    assert height(with_hole(0.3, None), 2.0, 2.0) == pytest.approx(0.0, abs=1e-3)
    assert stands(with_hole(1.2, None), (2.0, 2.0)) == [False]
    assert stands(with_hole(0.3, 0.6), (2.0, 2.0)) == [False]


def test_storeys_are_found_and_keep_apart(renderer: Renderer) -> None:
    # Two storeys of 4 x 4 m, an open top with walls around, a cupboard, a table.
    scene = patches(
        [
            level(0, 0, 4, 4),
            level(0, 0, 4, 3, 2.8),
            ((0, 0, 0), (4, 0, 0), (0, 5.2, 0)),
            ((0, 0, 0), (0, 0, 4), (0, 5.2, 0)),
            level(0.5, 0.5, 1.3, 1.3, 0.75),
            level(3.0, 0.0, 4.0, 0.6, 1.9),
        ]
    )
    floors = find_floors(scene, renderer)
    np.testing.assert_allclose(floors, [0.0, 2.8], atol=1e-3)
    lower, upper = (NavigationGrid.from_scene(scene, renderer, floor_height=floor) for floor in floors)
    assert stands(lower, (2.0, 3.5)) == [True]
    assert stands(upper, (2.0, 3.5)) == [False]
    assert height(lower, 2.0, 2.0) == pytest.approx(0.0, abs=1e-3)
    assert height(upper, 2.0, 2.0) == pytest.approx(2.8, abs=1e-3)


def test_a_ceiling_is_no_floor(renderer: Renderer, make_room: MakeRoom) -> None:
    assert find_floors(make_room(walls=[(1.0, 0.0, 1.0, 3.0, 0.75, 3.0)]), renderer) == (0.0,)


def test_a_grid_that_starts_where_nothing_is_says_so(renderer: Renderer) -> None:
    with pytest.raises(SceneError, match=r"0\.00 m2 of navigable floor at height 1\.20 m"):
        NavigationGrid.from_scene(scan(), renderer, floor_height=1.2)
