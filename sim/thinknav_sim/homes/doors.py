"""Doorways that join the rooms, and windows in the outer walls.

Rooms are joined as people would have it: from the hallway or the living room outwards, never through a bathroom, and
through a bedroom only when there is no better way; now and then one door more makes a loop.
"""

import math
from dataclasses import dataclass

import numpy as np

from thinknav_sim.homes.draw import between, chance

Rect = tuple[float, float, float, float]  # x0, z0, x1, z1

WALL_M = 0.12
DOOR_WIDTH_M = 0.9
DOOR_HEIGHT_M = 2.05
CASING_M = 0.07  # the frame around a door or window

# The sides of a room, by how many quarters a piece that stands against them is turned: it faces +z, +x, -z, -x.
NORTH, WEST, SOUTH, EAST = 0, 1, 2, 3

# What it costs a home's sense to enter a room from one of these.
_PASSAGE_COST = {
    "hallway": 0.0,
    "living room": 0.6,
    "studio": 0.6,
    "dining room": 1.0,
    "kitchen": 2.0,
    "study": 4.0,
    "bedroom": 6.0,
    "bathroom": math.inf,
}
_COMMON = frozenset({"hallway", "living room", "dining room", "kitchen"})


@dataclass(frozen=True)
class PlannedRoom:
    """A room's function and its cell: the rectangle between the centre lines of its walls, metres."""

    function: str
    cell: Rect

    @property
    def interior(self) -> Rect:
        """The floor: the cell less half a wall on each side."""
        x0, z0, x1, z1 = self.cell
        half = WALL_M / 2
        return (round(x0 + half, 4), round(z0 + half, 4), round(x1 - half, 4), round(z1 - half, 4))


@dataclass(frozen=True)
class Doorway:
    """An opening between two rooms: on which side of the first, and where it starts along x or z, metres."""

    rooms: tuple[int, int]
    side: int
    start: float

    @property
    def end(self) -> float:
        return round(self.start + DOOR_WIDTH_M, 4)

    def side_of(self, room: int) -> int:
        """The wall of one of the two rooms that the opening is in."""
        return self.side if room == self.rooms[0] else (self.side + 2) % 4


@dataclass(frozen=True)
class Window:
    """A window in an outer wall: start and end along x or z, sill and top heights, metres."""

    room: int
    side: int
    start: float
    end: float
    sill: float
    top: float


def _shared_wall(first: PlannedRoom, second: PlannedRoom) -> tuple[int, float, float] | None:
    """The side of the first room that touches the second, and the stretch where a door fits."""
    ax0, az0, ax1, az1 = first.cell
    bx0, bz0, bx1, bz1 = second.cell
    margin = WALL_M / 2 + CASING_M + 0.05
    meeting = {NORTH: az0 == bz1, SOUTH: az1 == bz0, WEST: ax0 == bx1, EAST: ax1 == bx0}
    for side, meets in meeting.items():
        if not meets:
            continue
        along_x = side in (NORTH, SOUTH)
        low = (max(ax0, bx0) if along_x else max(az0, bz0)) + margin
        high = (min(ax1, bx1) if along_x else min(az1, bz1)) - margin
        if high - low >= DOOR_WIDTH_M:
            return side, low, high
    return None


def connect(rng: np.random.Generator, rooms: tuple[PlannedRoom, ...]) -> tuple[tuple[Doorway, ...], float]:
    """Doorways that make one home of the rooms, and how awkward their order is (inf: it cannot be done decently)."""
    walls = {
        (first, second): shared
        for first in range(len(rooms))
        for second in range(len(rooms))
        if first != second and (shared := _shared_wall(rooms[first], rooms[second])) is not None
    }
    start = min(range(len(rooms)), key=lambda index: (_PASSAGE_COST[rooms[index].function], index))
    joined, pairs, awkwardness = {start}, [], 0.0
    while len(joined) < len(rooms):
        ways = [
            (_PASSAGE_COST[rooms[inner].function], inner, outer)
            for inner, outer in walls
            if inner in joined and outer not in joined
        ]
        if not ways or min(ways)[0] == math.inf:
            return (), math.inf
        cost, inner, outer = min(ways)
        awkwardness += cost
        joined.add(outer)
        pairs.append((inner, outer))
    spare = [
        (a, b)
        for a, b in walls
        if a < b and {rooms[a].function, rooms[b].function} <= _COMMON and not {(a, b), (b, a)} & set(pairs)
    ]
    if spare and chance(rng, 0.6):
        pairs.append(spare[int(rng.integers(len(spare)))])
    return tuple(_doorway(rng, pair, walls[pair]) for pair in pairs), awkwardness


def _doorway(rng: np.random.Generator, pair: tuple[int, int], wall: tuple[int, float, float]) -> Doorway:
    """Most doors stand near a corner, which leaves the wall to the furniture."""
    side, low, high = wall
    latest = high - DOOR_WIDTH_M
    if chance(rng, 0.65):
        slack = min(0.12, latest - low)
        start = low + slack if chance(rng, 0.5) else latest - slack
    else:
        start = low + (latest - low) * float(rng.random())
    return Doorway(pair, side, round(start, 2))


def cut_windows(rng: np.random.Generator, rooms: tuple[PlannedRoom, ...], outline: Rect) -> tuple[Window, ...]:
    """Windows: at least one in every room but bathrooms and hallways that has an outer wall."""
    windows: list[Window] = []
    for index, room in enumerate(rooms):
        outer = [side for side in range(4) if _is_outer(room, side, outline)]
        has_one = False
        for side in outer:
            x0, z0, x1, z1 = room.interior
            low, high = (x0, x1) if side in (NORTH, SOUTH) else (z0, z1)
            small = room.function in ("bathroom", "hallway")
            if high - low < (1.1 if small else 2.0) or chance(rng, 0.45 if has_one or small else 0.05):
                continue
            width = min(0.6 if small else between(rng, 1.2, 1.9), high - low - 0.5)
            slack = (high - low - width - 0.4) * float(rng.random())
            start = round(low + 0.2 + slack, 2) if chance(rng, 0.5) else round((low + high - width) / 2, 2)
            sill, top = (1.45, 2.1) if small else (0.9, 2.15)
            windows.append(Window(index, side, start, round(start + width, 2), sill, top))
            has_one = True
    return tuple(windows)


def _is_outer(room: PlannedRoom, side: int, outline: Rect) -> bool:
    edge = {NORTH: 1, WEST: 0, SOUTH: 3, EAST: 2}[side]
    return room.cell[edge] == outline[edge]
