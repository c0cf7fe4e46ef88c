"""Where furniture may stand in one room: without overlaps, clear of doors and windows, and so that one can walk.

An arrangement (a piece, or pieces that belong together) is accepted only if every doorway of the room can still be
reached from every other and every goal object still has free floor beside it. Knows nothing of what rooms are for.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from thinknav_sim.homes.doors import DOOR_HEIGHT_M, Rect
from thinknav_sim.homes.draw import shuffled
from thinknav_sim.homes.layout import FloorPlan
from thinknav_sim.homes.mesh import Mesh
from thinknav_sim.homes.walk_grid import BODY_M, WalkGrid
from thinknav_sim.homes.walls import Wall, walls_of
from thinknav_sim.scene import GOAL_CATEGORIES

WALL_GAP_M = 0.02  # furniture stands this far from walls, in front of the baseboard
PIECE_GAP_M = 0.03
DOOR_CLEARANCE_M = 0.8
HEADROOM_M = 1.05  # what hangs higher is no obstacle
SILL_SLACK_M = 0.3  # furniture may rise this far above a window's sill
STEP_M = 0.03  # what is flatter (a rug) is no obstacle


Where = Literal["any", "middle", "corner"]  # of a wall


@dataclass(frozen=True)
class Piece:
    """One object: its category, None for clutter, and its mesh."""

    category: str | None
    mesh: Mesh

    @cached_property
    def footprint(self) -> Rect:
        low, high = self.mesh.low, self.mesh.high
        return (float(low[0]), float(low[2]), float(high[0]), float(high[2]))

    @cached_property
    def heights(self) -> tuple[float, float]:
        """Of its lowest and its highest point."""
        return float(self.mesh.low[1]), float(self.mesh.high[1])

    @property
    def stands(self) -> bool:
        """Whether it is in the way of somebody who walks."""
        low, high = self.heights
        return low < HEADROOM_M and high > STEP_M


@dataclass(frozen=True)
class Arrangement:
    """Pieces placed as one, back at z = 0, front towards +z; clearance: floor kept free before them, metres."""

    pieces: tuple[Piece, ...]
    clearance: float = 0.0

    @cached_property
    def extent(self) -> Rect:
        """The rectangle around all its pieces."""
        x0, z0, x1, z1 = zip(*(piece.footprint for piece in self.pieces), strict=True)
        return (min(x0), min(z0), max(x1), max(z1))

    def placed(self, x: float, z: float, quarters: int) -> tuple[Piece, ...]:
        return tuple(
            Piece(piece.category, piece.mesh.quarter_turned(quarters).moved(x, 0.0, z)) for piece in self.pieces
        )


class WallSpan(NamedTuple):
    """A part of a wall that something covers: start and end along it, lowest and highest point, metres."""

    side: int
    start: float
    end: float
    low: float
    high: float

    def meets(self, other: "WallSpan") -> bool:
        gap = 0.04
        return (
            self.side == other.side
            and self.start < other.end + gap
            and other.start < self.end + gap
            and self.low < other.high
            and other.low < self.high
        )


def single(category: str | None, mesh: Mesh, clearance: float = 0.0) -> Arrangement:
    """An arrangement of one piece."""
    return Arrangement((Piece(category, mesh),), clearance)


def overlaps(first: Rect, second: Rect, gap: float = 0.0) -> bool:
    """Whether two rectangles come closer than `gap`."""
    return (
        first[0] < second[2] + gap
        and second[0] < first[2] + gap
        and first[1] < second[3] + gap
        and second[1] < first[3] + gap
    )


def _turned(rect: Rect, quarters: int, x: float, z: float) -> Rect:
    x0, z0, x1, z1 = rect
    for _ in range(quarters % 4):
        x0, z0, x1, z1 = z0, -x1, z1, -x0
    return (x0 + x, z0 + z, x1 + x, z1 + z)


class RoomSpace:
    """The free and taken places of one room. `pieces` are those placed so far, in world coordinates."""

    def __init__(self, plan: FloorPlan, index: int) -> None:
        self.function = plan.rooms[index].function
        self.interior = plan.rooms[index].interior
        self.walls = walls_of(self.interior)
        self.pieces: list[Piece] = []
        self._obstacles: list[Rect] = []
        self._kept_clear: list[Rect] = []
        self._windows = [
            WallSpan(window.side, window.start, window.end, window.sill + SILL_SLACK_M, window.top)
            for window in plan.windows
            if window.room == index
        ]
        self._on_walls: list[WallSpan] = []
        doors = [(door.side_of(index), door) for door in plan.doorways if index in door.rooms]
        entries = []
        for side, door in doors:
            wall = self.walls[side]
            self._kept_clear.append(_stretch(wall, door.start, door.end, DOOR_CLEARANCE_M))
            self._on_walls.append(WallSpan(side, door.start - 0.1, door.end + 0.1, 0.0, DOOR_HEIGHT_M + 0.1))
            entries.append(wall.position((door.start + door.end) / 2, BODY_M + 0.05))
        self._grid = WalkGrid(self.interior, entries)

    @property
    def area(self) -> float:
        x0, z0, x1, z1 = self.interior
        return (x1 - x0) * (z1 - z0)

    def count(self, category: str) -> int:
        return sum(piece.category == category for piece in self.pieces)

    def try_place(self, arrangement: Arrangement, x: float, z: float, quarters: int) -> bool:
        """Place it with its origin at (x, z), turned, if that is allowed; says whether it was."""
        extent = arrangement.extent
        if not _inside(_turned(extent, quarters, x, z), self.interior):
            return False
        front = _turned((extent[0], extent[3], extent[2], extent[3] + arrangement.clearance), quarters, x, z)
        if arrangement.clearance and (
            not _inside(front, self.interior) or any(overlaps(front, rect) for rect in self._obstacles)
        ):
            return False
        places = [(piece, _turned(piece.footprint, quarters, x, z)) for piece in arrangement.pieces]
        footprints = [place for piece, place in places if piece.stands]
        if any(overlaps(a, b, PIECE_GAP_M) for a in footprints for b in self._obstacles):
            return False
        if any(overlaps(a, b) for a in footprints for b in self._kept_clear):
            return False
        spans = [span for piece, place in places for span in self._spans(piece, place)]
        if any(span.meets(other) for span in spans for other in self._windows + self._on_walls):
            return False
        goals = [place for piece, place in places if piece.category in GOAL_CATEGORIES]
        if footprints and not self._grid.accept(footprints, goals):
            return False
        self.pieces += arrangement.placed(x, z, quarters)
        self._obstacles += footprints
        self._on_walls += spans
        if arrangement.clearance:
            self._kept_clear.append(front)
        return True

    def _spans(self, piece: Piece, place: Rect) -> Iterator[WallSpan]:
        """The parts of walls that a piece hides; a rug hides none."""
        if piece.heights[1] <= STEP_M:
            return
        for wall in self.walls:
            along = 0 if wall.along_x else 1
            if min(abs(place[1 - along] - wall.line), abs(place[3 - along] - wall.line)) < 0.25:
                yield WallSpan(wall.side, place[along], place[2 + along], *piece.heights)

    def stand(self, arrangement: Arrangement, rng: np.random.Generator, where: Where = "any", tries: int = 14) -> bool:
        """Stand it with its back to a wall, `where` first; says whether one of so many tries found a place."""
        x0, z0, x1, z1 = arrangement.extent
        half = (x1 - x0) / 2 + WALL_GAP_M
        spots: dict[Where, list[tuple[Wall, float]]] = {"any": [], "middle": [], "corner": []}
        for wall in shuffled(rng, self.walls):
            low, high = wall.start + half, wall.end - half
            if high < low or wall.span < z1 - z0:
                continue
            spots["corner"] += [(wall, low), (wall, high)]
            spots["middle"].append((wall, (low + high) / 2))
            spots["any"] += [(wall, low + (high - low) * float(rng.random())) for _ in range(4)]
        second: Where = "corner" if where == "any" else "any"
        for wall, t in (spots[where] + spots[second])[:tries]:
            center = t - self._side_offset(wall, (x0 + x1) / 2)
            x, z = wall.position(center, WALL_GAP_M - z0)
            if self.try_place(arrangement, x, z, wall.side):
                return True
        return False

    @staticmethod
    def _side_offset(wall: Wall, shift: float) -> float:
        """Where along the wall a point at local x = shift comes to lie, from the arrangement's origin."""
        return {0: shift, 1: -shift, 2: -shift, 3: shift}[wall.side]

    def float_freely(self, arrangement: Arrangement, rng: np.random.Generator, tries: int = 24) -> bool:
        """Place it anywhere in the room, the middle first."""
        x0, z0, x1, z1 = self.interior
        extent = arrangement.extent
        for attempt in range(tries):
            share = min(1.0, attempt / 8)
            x = (x0 + x1) / 2 + (x1 - x0) / 2 * share * (2 * float(rng.random()) - 1)
            z = (z0 + z1) / 2 + (z1 - z0) / 2 * share * (2 * float(rng.random()) - 1)
            quarters = int(rng.integers(4))
            middle = _turned(extent, quarters, 0.0, 0.0)
            center = ((middle[0] + middle[2]) / 2, (middle[1] + middle[3]) / 2)
            if self.try_place(arrangement, x - center[0], z - center[1], quarters):
                return True
        return False

    def hang(self, piece: Piece, rng: np.random.Generator, tries: int = 8) -> bool:
        """Hang a flat thing on a wall where there is no door, window, tall furniture or other such thing."""
        half = (piece.footprint[2] - piece.footprint[0]) / 2
        for _ in range(tries):
            wall = self.walls[int(rng.integers(4))]
            room = wall.end - wall.start - 2 * half - 0.3
            if room < 0:
                continue
            t = wall.start + half + 0.15 + room * float(rng.random())
            span = WallSpan(wall.side, t - half, t + half, *piece.heights)
            if any(span.meets(other) for other in self._on_walls + self._windows):
                continue
            x, z = wall.position(t, 0.003)
            self.pieces.append(Piece(piece.category, piece.mesh.quarter_turned(wall.side).moved(x, 0.0, z)))
            self._on_walls.append(span)
            return True
        return False

    def lay(self, piece: Piece, x: float, z: float, quarters: int = 0) -> bool:
        """Lay a flat or hanging thing, no obstacle, about a point of the floor, if it stays within the room."""
        mesh = piece.mesh.quarter_turned(quarters).moved(x, 0.0, z)
        placed = Piece(piece.category, mesh)
        if not _inside(placed.footprint, self.interior):
            return False
        self.pieces.append(placed)
        return True

    @property
    def footprints(self) -> tuple[Rect, ...]:
        """The floor that furniture stands on."""
        return tuple(self._obstacles)


def _stretch(wall: Wall, start: float, end: float, depth: float) -> Rect:
    (ax, az), (bx, bz) = wall.position(start, 0.0), wall.position(end, depth)
    return (min(ax, bx), min(az, bz), max(ax, bx), max(az, bz))


def _inside(rect: Rect, room: Rect) -> bool:
    slack = 0.005
    return (
        rect[0] >= room[0] + slack
        and rect[1] >= room[1] + slack
        and rect[2] <= room[2] - slack
        and rect[3] <= room[3] - slack
    )
