"""Which starts are of the storey that is played in."""

from dataclasses import replace

import numpy as np
import pytest

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.objectnav import is_of_played_storey
from thinknav_sim.scene import Scene


@pytest.mark.parametrize(
    ("start", "is_of_it"),
    [
        ((1.0, 2.5, 1.0), True),  # at the top of the stairs, where one can stand
        ((1.0, 0.0, 1.0), False),
        ((4.0, 2.8, 1.0), False),  # off the grid, and as high as the upper storey
        ((4.0, 2.1, 1.0), False),
    ],
)
def test_starts_above_the_grid_or_beside_it(
    empty_room: Scene, start: tuple[float, float, float], is_of_it: bool
) -> None:
    scene = replace(empty_room, floors=(0.0, 2.8))
    top = NavigationGrid.from_mask("room", np.ones((40, 40), np.bool_), np.zeros(2), 0.05, floor_height=2.5)
    assert is_of_played_storey(scene, top, np.array(start)) is is_of_it
    # Where a scene has no other storey, a start that is off the grid is a mistake and not of another one.
    assert is_of_played_storey(empty_room, top, np.array(start)) is (start[1] > 0)
