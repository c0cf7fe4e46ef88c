"""Baked light: brighter towards windows, darker in corners and under furniture, and lamps that shine by themselves."""

import numpy as np
import pytest

from thinknav_sim.homes.doors import NORTH, Window
from thinknav_sim.homes.lighting import RoomLight
from thinknav_sim.homes.materials import LAMP_GLOW
from thinknav_sim.homes.mesh import Color, Mesh

ROOM = (0.0, 0.0, 4.0, 4.0)
NORTH_WINDOW = Window(0, NORTH, 1.3, 2.7, 0.9, 2.1)
GREY: Color = (0.5, 0.5, 0.5)
PLAIN = RoomLight(ROOM, (), (1.0, 1.0, 1.0), ())
UP, SOUTHWARDS, NORTHWARDS = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)


def seen(light: RoomLight, place: Color, normal: Color, color: Color = GREY) -> float:
    """How bright a spot of surface looks, 0 to 255."""
    spot = Mesh(np.array([place]), np.array([normal]), np.array([color]), np.zeros((1, 3), dtype=np.int32))
    return float(light.bake(spot).astype(np.float64).mean())


def test_what_faces_the_window_is_brighter() -> None:
    light = RoomLight(ROOM, (NORTH_WINDOW,), (1.0, 1.0, 1.0), ())
    assert seen(light, (2.0, 1.3, 2.0), NORTHWARDS) > seen(light, (2.0, 1.3, 2.0), SOUTHWARDS) + 10


def test_near_the_window_is_brighter() -> None:
    light = RoomLight(ROOM, (NORTH_WINDOW,), (1.0, 1.0, 1.0), ())
    assert seen(light, (2.0, 0.0, 1.0), UP) > seen(light, (2.0, 0.0, 3.0), UP) + 3


@pytest.mark.parametrize("corner", [(0.05, 0.0, 2.0), (2.0, 0.0, 3.95)])
def test_corners_are_darker(corner: Color) -> None:
    assert seen(PLAIN, corner, UP) < 0.85 * seen(PLAIN, (2.0, 0.0, 2.0), UP)


def test_a_wall_is_not_darkened_by_itself() -> None:
    assert seen(PLAIN, (2.0, 1.3, 0.0), SOUTHWARDS) == seen(PLAIN, (2.0, 1.3, 2.0), SOUTHWARDS)


def test_floor_under_furniture_is_in_shadow() -> None:
    light = RoomLight(ROOM, (), (1.0, 1.0, 1.0), ((1.5, 1.5, 2.5, 2.5),))
    under, beside, away = (seen(light, (x, 0.0, 2.0), UP) for x in (2.0, 2.6, 3.2))
    assert under < 0.7 * away
    assert under < beside < away
    assert seen(light, (2.0, 0.5, 2.0), UP) == away, "the furniture itself is not"


def test_lamps_shine_by_themselves() -> None:
    light = RoomLight(ROOM, (), (0.5, 0.5, 0.5), ((0.0, 0.0, 4.0, 4.0),))
    assert seen(light, (0.05, 0.0, 0.05), UP, LAMP_GLOW) > 240


def test_rooms_are_tinted() -> None:
    warm = RoomLight(ROOM, (), (1.03, 1.0, 0.97), ())
    spot = Mesh(np.array([(2.0, 0.0, 2.0)]), np.array([UP]), np.array([GREY]), np.zeros((1, 3), dtype=np.int32))
    red, green, blue = warm.bake(spot)[0].astype(int)
    assert red > green > blue
