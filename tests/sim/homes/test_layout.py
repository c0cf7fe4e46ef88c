"""Floor plans: sizes, no overlaps, and that every room is reached without crossing a bathroom."""

import functools

import numpy as np
import pytest

from thinknav_sim.homes.doors import DOOR_WIDTH_M, WALL_M, Rect
from thinknav_sim.homes.draw import stream
from thinknav_sim.homes.layout import AREAS, MAX_ROOMS, FloorPlan, draw_plan
from thinknav_sim.homes.walls import walls_of

SEEDS = range(6)


@functools.cache
def plans(count: int) -> list[FloorPlan]:
    return [draw_plan(stream(seed, count), count) for seed in SEEDS]


def area(rect: Rect) -> float:
    return (rect[2] - rect[0]) * (rect[3] - rect[1])


@pytest.mark.parametrize("count", range(1, MAX_ROOMS + 1))
def test_rooms_fill_the_outline(count: int) -> None:
    for plan in plans(count):
        assert len(plan.rooms) == count
        cells = [room.cell for room in plan.rooms]
        assert sum(map(area, cells)) == pytest.approx(area(plan.outline), rel=1e-3)
        for index, a in enumerate(cells):
            for b in cells[index + 1 :]:
                assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


@pytest.mark.parametrize("count", range(1, MAX_ROOMS + 1))
def test_room_sizes_are_sensible(count: int) -> None:
    for plan in plans(count):
        for room in plan.rooms:
            _, least, most = AREAS[room.function]
            assert least <= area(room.interior) <= most, room


@pytest.mark.parametrize("count", range(2, MAX_ROOMS + 1))
def test_rooms_are_reached_without_crossing_a_bathroom(count: int) -> None:
    for plan in plans(count):
        start = next(index for index, room in enumerate(plan.rooms) if room.function != "bathroom")
        reached, frontier = {start}, [start]
        while frontier:
            room = frontier.pop()
            if plan.rooms[room].function == "bathroom":
                continue
            for door in plan.doorways:
                if room in door.rooms:
                    other = door.rooms[1] if door.rooms[0] == room else door.rooms[0]
                    if other not in reached:
                        reached.add(other)
                        frontier.append(other)
        assert len(reached) == count


@pytest.mark.parametrize("count", range(2, MAX_ROOMS + 1))
def test_doorways_lie_in_both_rooms_walls(count: int) -> None:
    for plan in plans(count):
        for door in plan.doorways:
            assert door.end - door.start == pytest.approx(DOOR_WIDTH_M)
            lines = []
            for room in door.rooms:
                wall = walls_of(plan.rooms[room].interior)[door.side_of(room)]
                assert wall.start < door.start
                assert door.end < wall.end
                lines.append(wall.line)
            assert abs(lines[0] - lines[1]) == pytest.approx(WALL_M)


def test_windows_are_in_outer_walls_only() -> None:
    for plan in plans(6):
        assert plan.windows
        for window in plan.windows:
            wall = walls_of(plan.rooms[window.room].interior)[window.side]
            assert np.min(np.abs(np.array(plan.outline) - wall.line)) == pytest.approx(WALL_M / 2)
            assert wall.start < window.start < window.end < wall.end


def test_some_homes_have_loops() -> None:
    loops = [len(draw_plan(stream(seed), 6).doorways) > 5 for seed in range(12)]
    assert any(loops)
    assert not all(loops)
