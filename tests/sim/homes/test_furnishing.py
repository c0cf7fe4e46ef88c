"""Where furniture stands: inside rooms, apart from each other, as people would have it."""

import itertools

import numpy as np
from thinknav_sim.homes.draw import stream
from thinknav_sim.homes.furniture.beds import bed
from thinknav_sim.homes.layout import FloorPlan, draw_plan
from thinknav_sim.homes.materials import Style
from thinknav_sim.homes.mesh import box
from thinknav_sim.homes.placement import RoomSpace, overlaps, single
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


def test_doorways_stay_clear() -> None:
    plan = draw_plan(stream(4), 5)
    for index in range(5):
        space = RoomSpace(plan, index)
        for door in (door for door in plan.doorways if index in door.rooms):
            wall = space.walls[door.side_of(index)]
            x, z = wall.position((door.start + door.end) / 2, 0.4)
            assert not space.try_place(single("box", box((0, 0, 0), (0.2, 0.5, 0.2), (1, 1, 1))), x, z, 0)


def has_opposite_doors(plan: FloorPlan, room: int) -> bool:
    return {door.side_of(room) for door in plan.doorways if room in door.rooms} in ({0, 2}, {1, 3})


def test_placement_refuses_what_would_block_the_way() -> None:
    """A wall of boxes across a room with two doorways on opposite sides is never completed."""
    candidates = (draw_plan(stream(seed), 6) for seed in range(50))
    plan, index = next((plan, index) for plan in candidates for index in range(6) if has_opposite_doors(plan, index))
    space = RoomSpace(plan, index)
    x0, z0, x1, z1 = space.interior
    cube = single("box", box((0, 0, 0), (0.38, 0.5, 0.38), (1, 1, 1)))
    sides = [door.side_of(index) for door in plan.doorways if index in door.rooms]
    across_x = sides[0] in (0, 2)
    placed = 0
    length = x1 - x0 if across_x else z1 - z0
    slots = int(length / 0.42)
    for slot in range(slots):
        along = 0.21 + slot * 0.42
        x, z = (x0 + along, (z0 + z1) / 2) if across_x else ((x0 + x1) / 2, z0 + along)
        placed += space.try_place(cube, x, z, 0)
    assert 0 < placed < slots


def test_a_bed_needs_its_room() -> None:
    plan = draw_plan(stream(2), 3)
    bathroom = next(index for index, room in enumerate(plan.rooms) if room.function == "bathroom")
    rng = stream(0)
    wide = single("bed", bed(rng, Style.draw(rng), 1.6))
    x0, z0, x1, z1 = plan.rooms[bathroom].interior
    space = RoomSpace(plan, bathroom)
    assert not space.try_place(wide, x1 + 0.1, z0, 0), "through the wall"
    assert space.pieces == []


def test_overlap_of_rectangles() -> None:
    assert overlaps((0, 0, 1, 1), (0.9, 0.9, 2, 2))
    assert not overlaps((0, 0, 1, 1), (1, 0, 2, 1))
    assert overlaps((0, 0, 1, 1), (1.02, 0, 2, 1), gap=0.03)
