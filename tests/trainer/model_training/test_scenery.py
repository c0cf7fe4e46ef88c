"""What frames show, in rooms made by hand and in homes."""

import math

import numpy as np
import pytest

from tests.trainer.test_visible import CAMERA, room_with, wall
from thinknav_sim.scene import Room
from thinknav_trainer.model_training.scenery import Scenery, Sight, Way, reach_of, room_at, scenery, side_of

ORIGIN = np.zeros((1, 4))


def test_sides_and_reaches() -> None:
    assert [side_of(math.radians(angle)) for angle in (30, 5, -5, -30)] == ["left", "ahead", "ahead", "right"]
    assert [reach_of(distance) for distance in (0.5, 2.0, 5.0)] == ["near", "middle", "far"]


def test_things_of_one_category_on_one_side_are_one_sight() -> None:
    scene = room_with(
        ("chair", (-1.5, 0.0, -2.1), (-1.2, 1.5, -2.0)),
        ("chair", (-0.9, 0.0, -2.1), (-0.6, 1.5, -2.0)),
        ("sofa", (0.6, 0.0, -2.1), (1.6, 1.5, -2.0)),
    )
    (seen,) = scenery(scene, ORIGIN, wall(2.0), CAMERA)
    assert set(seen.sights) == {Sight("chair", "left", "middle", many=True), Sight("sofa", "right", "middle")}
    assert (seen.ways, seen.room) == ((), None)


@pytest.mark.parametrize(("distance", "blocked"), [(0.5, True), (1.5, None), (4.0, False)])
def test_whether_the_way_is_blocked(distance: float, blocked: bool | None) -> None:
    (seen,) = scenery(room_with(), ORIGIN, wall(distance), CAMERA)
    assert seen.blocked is blocked


def test_a_view_into_another_room_is_a_way_out() -> None:
    here, there = Room("study", (-1.0, -1.0, 1.0, 1.0)), Room("kitchen", (-3.0, -3.0, -0.5, -1.2))
    scene = room_with()
    object.__setattr__(scene, "rooms", (here, there))
    (seen,) = scenery(scene, ORIGIN, wall(2.0), CAMERA)
    assert seen.room == "study" == room_at(scene, ORIGIN[0])
    assert seen.ways == (Way("left", "kitchen"),)


def test_a_mirrored_frame_shows_left_for_right() -> None:
    seen = Scenery((Sight("bed", "left", "near"), Sight("lamp", "ahead", "far")), (Way("right", "study"),), None, True)
    assert seen.mirrored().sights == (Sight("bed", "right", "near"), Sight("lamp", "ahead", "far"))
    assert seen.mirrored().ways == (Way("left", "study"),)
    assert seen.mirrored().mirrored() == seen
