"""The floor plan: which rooms a home has, how large they are, and where their walls stand.

Candidates are drawn (a recursive split, or two bands of rooms along a corridor) and the best-proportioned one whose
rooms can all be reached decently (`doors`) is kept. Knows nothing of geometry above the floor.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thinknav_sim.homes.doors import Doorway, PlannedRoom, Rect, Window, connect, cut_windows
from thinknav_sim.homes.draw import between, chance, shuffled

MAX_ROOMS = 8
CORRIDOR_WIDTH_M = (1.35, 1.65)

# Target floor area, and the least and the most that a plan may give, in square metres.
AREAS: dict[str, tuple[float, float, float]] = {
    "living room": (21.0, 14.0, 28.0),
    "studio": (25.0, 18.0, 32.0),
    "kitchen": (11.5, 8.0, 15.0),
    "dining room": (13.0, 9.0, 17.0),
    "bedroom": (14.0, 9.0, 17.0),
    "bathroom": (6.2, 4.0, 7.2),
    "study": (10.5, 7.0, 13.0),
    "hallway": (7.0, 4.0, 15.0),
}
LEAST_SIDE_M = {"hallway": 1.2, "bathroom": 1.7}
MOST_SLENDER = {"hallway": 9.0, "bathroom": 2.3}
_LEAST_SIDE_M, _MOST_SLENDER = 2.5, 1.9  # of the other rooms

_CANDIDATES = 12  # to choose the best from
_MAX_DRAWS = 3_000
_CUTS = 4  # ways to cut a rectangle that are tried before giving it up


class LayoutError(RuntimeError):
    """No acceptable floor plan was drawn; the message names the rooms."""


@dataclass(frozen=True)
class FloorPlan:
    """Rooms with the doorways and windows in their walls. outline: the centre lines of the outer walls."""

    outline: Rect
    rooms: tuple[PlannedRoom, ...]
    doorways: tuple[Doorway, ...]
    windows: tuple[Window, ...]


@dataclass(frozen=True)
class _Demand:
    """A room that is still without a place."""

    index: int
    function: str
    area: float


def draw_plan(rng: np.random.Generator, count: int) -> FloorPlan:
    """A floor plan of `count` rooms. Raises LayoutError when none was found."""
    functions = _room_functions(rng, count)
    best: tuple[float, Rect, tuple[PlannedRoom, ...], tuple[Doorway, ...]] | None = None
    accepted = 0
    for _ in range(_MAX_DRAWS):
        drawn = _draw_rooms(rng, functions)
        if drawn is None:
            continue
        outline, rooms = drawn
        doorways, awkwardness = connect(rng, rooms)
        if awkwardness == math.inf:
            continue
        score = awkwardness + sum(_slenderness(room) for room in rooms if room.function != "hallway")
        if best is None or score < best[0]:
            best = (score, outline, rooms, doorways)
        accepted += 1
        if accepted == _CANDIDATES:
            break
    if best is None:
        raise LayoutError(f"no floor plan found for the rooms {', '.join(functions)} in {_MAX_DRAWS} draws")
    _, outline, rooms, doorways = best
    return FloorPlan(outline, rooms, doorways, cut_windows(rng, rooms, outline))


def _room_functions(rng: np.random.Generator, count: int) -> list[str]:
    small = {
        1: ["studio"],
        2: ["studio", "bathroom"],
        3: ["living room", "bedroom", "bathroom"],
        4: ["living room", "kitchen", "bedroom", "bathroom"],
    }
    if count in small:
        return small[count]
    extras = shuffled(rng, ("bedroom", "study", "dining room"))
    # Large homes need a hallway, or people walk through bedrooms.
    extras.insert(0 if count >= 6 or chance(rng, 0.6) else 1, "hallway")
    return small[4] + extras[: count - 4]


def _draw_rooms(rng: np.random.Generator, functions: Sequence[str]) -> tuple[Rect, tuple[PlannedRoom, ...]] | None:
    """Rooms in their places, in the order of `functions`; None when this draw does not work out."""
    demands = [_Demand(index, name, AREAS[name][0] * between(rng, 0.85, 1.15)) for index, name in enumerate(functions)]
    total = _area(demands)
    width = round(math.sqrt(total * between(rng, 0.9, 2.2 if len(functions) < 4 else 1.6)), 2)
    if "hallway" in functions and (len(functions) >= 6 or chance(rng, 0.7)):
        drawn = _along_corridor(rng, demands, width)
    else:
        outline = (0.0, 0.0, width, round(total / width, 2))
        cells = _split(rng, outline, demands)
        drawn = None if cells is None else (cells, outline)
    if drawn is None:
        return None
    cells, outline = drawn
    rooms = [PlannedRoom(name, cells[index]) for index, name in enumerate(functions)]
    if chance(rng, 0.5):
        outline, rooms = _transposed(outline), [PlannedRoom(room.function, _transposed(room.cell)) for room in rooms]
    return outline, tuple(rooms)


def _area(demands: Sequence[_Demand]) -> float:
    return sum(demand.area for demand in demands)


def _transposed(rect: Rect) -> Rect:
    x0, z0, x1, z1 = rect
    return (z0, x0, z1, x1)


def _split(rng: np.random.Generator, rect: Rect, demands: Sequence[_Demand]) -> dict[int, Rect] | None:
    """Cut the rectangle in two by area, again and again, until each part is one usable room."""
    if len(demands) == 1:
        return {demands[0].index: rect} if _is_usable(PlannedRoom(demands[0].function, rect)) else None
    if min(rect[2] - rect[0], rect[3] - rect[1]) < min(LEAST_SIDE_M.get(d.function, _LEAST_SIDE_M) for d in demands):
        return None
    for first, second, halves in _ways_to_cut(rng, rect, demands):
        placed = _split(rng, halves[0], first)
        rest = None if placed is None else _split(rng, halves[1], second)
        if placed is not None and rest is not None:
            return placed | rest
    return None


def _ways_to_cut(
    rng: np.random.Generator, rect: Rect, demands: Sequence[_Demand]
) -> Iterator[tuple[list[_Demand], list[_Demand], tuple[Rect, Rect]]]:
    x0, z0, x1, z1 = rect
    for _ in range(min(_CUTS, len(demands))):
        order = shuffled(rng, demands)
        cut = 1 + int(rng.integers(len(order) - 1))
        first, second = order[:cut], order[cut:]
        share = _area(first) / _area(order)
        if (x1 - x0 > z1 - z0) != chance(rng, 0.15):
            line = round(x0 + (x1 - x0) * share, 2)
            yield first, second, ((x0, z0, line, z1), (line, z0, x1, z1))
        else:
            line = round(z0 + (z1 - z0) * share, 2)
            yield first, second, ((x0, z0, x1, line), (x0, line, x1, z1))


def _along_corridor(
    rng: np.random.Generator, demands: Sequence[_Demand], width: float
) -> tuple[dict[int, Rect], Rect] | None:
    """A corridor with a band of rooms on either side, across the home or up to one room that closes its far end."""
    corridor = next(demand for demand in demands if demand.function == "hallway")
    rooms = shuffled(rng, [demand for demand in demands if demand is not corridor])
    end = [rooms.pop()] if len(rooms) > 3 and chance(rng, 0.6) else []
    cut = len(rooms) // 2 + int(rng.integers(2)) * (len(rooms) % 2)
    north, south = rooms[:cut], rooms[cut:]
    z1 = round(_area(north) / width, 2)
    z2 = round(z1 + between(rng, *CORRIDOR_WIDTH_M), 2)
    z3 = round(z2 + _area(south) / width, 2)
    far = round(width + _area(end) / z3, 2) if end else width
    cells: dict[int, Rect] = {corridor.index: (0.0, z1, width, z2)}
    if not _is_usable(PlannedRoom("hallway", cells[corridor.index])):
        return None
    for band, rect in ((north, (0.0, 0.0, width, z1)), (south, (0.0, z2, width, z3)), (end, (width, 0.0, far, z3))):
        placed = _split(rng, rect, band) if band else {}
        if placed is None:
            return None
        cells |= placed
    return cells, (0.0, 0.0, far, z3)


def _sides(room: PlannedRoom) -> tuple[float, float]:
    """The short and the long side of a room's floor, metres."""
    x0, z0, x1, z1 = room.interior
    return min(x1 - x0, z1 - z0), max(x1 - x0, z1 - z0)


def _slenderness(room: PlannedRoom) -> float:
    short, long = _sides(room)
    return (long / short - 1.25) ** 2


def _is_usable(room: PlannedRoom) -> bool:
    short, long = _sides(room)
    if short < LEAST_SIDE_M.get(room.function, _LEAST_SIDE_M):
        return False
    _, least, most = AREAS[room.function]
    return long / short <= MOST_SLENDER.get(room.function, _MOST_SLENDER) and least <= long * short <= most
