"""Navigation complexity against homes whose worst detour is known."""

import pytest

from thinknav_sim.navigation import NavigationGrid, navigation_complexity
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene


def test_an_empty_room_is_as_simple_as_can_be(empty_room: Scene, renderer: Renderer) -> None:
    complexity = navigation_complexity(NavigationGrid.from_scene(empty_room, renderer), sources=20)
    assert 1.0 <= complexity < 1.05


def test_a_wall_makes_a_detour(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    """On either side of a wall of 5 m, 1 m apart at its closed end, one walks about 10 m around."""
    wall = (0.0, 0.0, 2.95, 5.0, 2.5, 3.05)
    grid = NavigationGrid.from_scene(make_room(walls=[wall]), renderer)
    complexity = navigation_complexity(grid, sources=400)
    assert 9.0 < complexity < 10.6
    assert navigation_complexity(grid, sources=20) <= complexity
    assert navigation_complexity(grid, sources=20) == navigation_complexity(grid, sources=20)


@pytest.mark.parametrize("length", [2.0, 3.5])
def test_a_shorter_wall_is_simpler(make_room, renderer: Renderer, length: float) -> None:  # type: ignore[no-untyped-def]
    def complexity(reach: float) -> float:
        scene = make_room(walls=[(0.0, 0.0, 2.95, reach, 2.5, 3.05)])
        return navigation_complexity(NavigationGrid.from_scene(scene, renderer), sources=100)

    assert complexity(length) < complexity(length + 1.5)
