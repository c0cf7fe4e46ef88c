"""Where furniture stands: inside rooms, apart from each other, as people would have it."""

import itertools

import numpy as np
import pytest

from thinknav_sim.homes.doors import EAST, WEST, Doorway, PlannedRoom
from thinknav_sim.homes.draw import stream
from thinknav_sim.homes.furniture.beds import bed
from thinknav_sim.homes.layout import FloorPlan, draw_plan
from thinknav_sim.homes.materials import Style
from thinknav_sim.homes.mesh import box
from thinknav_sim.homes.placement import Arrangement, RoomSpace, overlaps, single
from thinknav_sim.scene import Box, ObjectInstance, Scene

# A sink and a stove are let into the counter.
LET_IN = {frozenset({"counter", "sink"}), frozenset({"counter", "stove"})}
TOLERANCE_M = 0.02


def overlap(first: Box, second: Box) -> float:
    """How deep two boxes stand in each other, metres; 0 or less when apart."""
    return float((np.minimum(first.high, second.high) - np.maximum(first.low, second.low)).min())


def test_objects_stand_apart(homes: list[Scene]) -> None:
    for home in homes:
        for first, second in itertools.combinations(home.objects, 2):
            if frozenset({first.category, second.category}) in LET_IN:
                continue
            assert overlap(first.box, second.box) <= TOLERANCE_M, (home.name, first, second)


def test_objects_stay_inside_one_room(homes: list[Scene]) -> None:
    for home in homes:
        for instance in home.objects:
            low, high = instance.box.low, instance.box.high
            inside = [
                room
                for room in home.rooms
                if room.bounds[0] <= low[0] + 1e-6
                and room.bounds[1] <= low[2] + 1e-6
                and high[0] <= room.bounds[2] + 1e-6
                and high[2] <= room.bounds[3] + 1e-6
            ]
            assert len(inside) == 1, (home.name, instance)
            assert low[1] >= -0.001
            assert high[1] <= 2.6 + 1e-6, (home.name, instance)


def gap_to_wall(home: Scene, instance: ObjectInstance) -> float:
    x, _, z = instance.box.center
    room = next(r.bounds for r in home.rooms if r.bounds[0] < x < r.bounds[2] and r.bounds[1] < z < r.bounds[3])
    low, high = instance.box.low, instance.box.high
    return float(min(low[0] - room[0], low[2] - room[1], room[2] - high[0], room[3] - high[2]))


def test_beds_toilets_and_wardrobes_stand_at_a_wall(homes: list[Scene]) -> None:
    for home in homes:
        for category in ("bed", "toilet", "wardrobe", "fridge", "sink"):
            for instance in home.objects_of(category):
                assert gap_to_wall(home, instance) < 0.1, (home.name, instance)


def test_most_televisions_have_a_sofa_across(homes: list[Scene]) -> None:
    facing = []
    for home in homes:
        for sofa in home.objects_of("sofa"):
            distances = [
                float(np.abs(screen.box.center - sofa.box.center)[[0, 2]].max())
                for screen in home.objects_of("tv_monitor")
                if np.abs(screen.box.center - sofa.box.center)[[0, 2]].min() < 0.4
            ]
            facing.append(any(1.5 < distance < 4.6 for distance in distances))
    assert np.mean(facing) > 0.7


def test_chairs_stand_at_tables_or_alone(homes: list[Scene]) -> None:
    """There are chairs whose seats touch a table's or desk's edge, within a hand's breadth."""
    seated = [
        any(
            overlap(Box(chair.box.low - 0.1, chair.box.high + 0.1), table.box) > 0
            for table in (*home.objects_of("table"), *home.objects_of("desk"))
        )
        for home in homes
        for chair in home.objects_of("chair")
    ]
    assert np.mean(seated) > 0.4


def three_in_a_row(doors: bool) -> FloorPlan:
    """A study of 4 x 4 m between a living room and a kitchen, with doorways to both or to none."""
    functions = ("living room", "study", "kitchen")
    rooms = tuple(PlannedRoom(name, (4.0 * i, 0.0, 4.0 * (i + 1), 4.0)) for i, name in enumerate(functions))
    doorways = (Doorway((1, 0), WEST, 1.0), Doorway((1, 2), EAST, 2.0)) if doors else ()
    return FloorPlan((0.0, 0.0, 12.0, 4.0), rooms, doorways, ())


def cube(side: float) -> Arrangement:
    return single("box", box((0, 0, 0), (side, 0.5, side), (1, 1, 1)))


def test_doorways_stay_clear() -> None:
    space = RoomSpace(three_in_a_row(doors=True), 1)
    for z in (1.1, 1.45, 1.8):
        assert not space.try_place(cube(0.1), 4.06 + 0.7, z, 0), "before the doorway"
    assert space.try_place(cube(0.1), 4.06 + 0.7, 2.2, 0), "beside it"
    assert RoomSpace(three_in_a_row(doors=False), 1).try_place(cube(0.1), 4.06 + 0.7, 1.1, 0)


@pytest.mark.parametrize("doors", [True, False])
def test_placement_never_closes_the_way_between_doorways(doors: bool) -> None:
    space = RoomSpace(three_in_a_row(doors), 1)
    placed = [space.try_place(cube(0.44), 6.0, 0.3 + 0.48 * slot, 0) for slot in range(8)]
    assert all(placed[:6])
    assert all(placed) != doors


def test_placement_never_walls_in_a_goal() -> None:
    space = RoomSpace(three_in_a_row(doors=True), 1)
    assert space.try_place(single("chair", cube(0.4).pieces[0].mesh), 6.0, 3.7, 0)
    around = [(5.25, 3.5), (5.25, 2.7), (6.0, 2.7), (6.75, 2.7), (6.75, 3.5)]
    placed = [space.try_place(cube(0.7), x, z, 0) for x, z in around]
    assert placed == [True, True, True, True, False]


def test_overlapping_furniture_is_refused() -> None:
    space = RoomSpace(three_in_a_row(doors=True), 1)
    assert space.try_place(cube(0.5), 6.0, 2.0, 0)
    assert not space.try_place(cube(0.5), 6.4, 2.0, 0)
    assert len(space.pieces) == 1


def test_a_bed_needs_its_room() -> None:
    plan = draw_plan(stream(2), 3)
    bathroom = next(index for index, room in enumerate(plan.rooms) if room.function == "bathroom")
    rng = stream(0)
    wide = single("bed", bed(rng, Style.draw(rng), 1.6))
    space = RoomSpace(plan, bathroom)
    assert not space.try_place(wide, space.interior[2] + 0.1, space.interior[1], 0), "through the wall"
    assert space.pieces == []


def test_overlap_of_rectangles() -> None:
    assert overlaps((0, 0, 1, 1), (0.9, 0.9, 2, 2))
    assert not overlaps((0, 0, 1, 1), (1, 0, 2, 1))
    assert overlaps((0, 0, 1, 1), (1.02, 0, 2, 1), gap=0.03)
