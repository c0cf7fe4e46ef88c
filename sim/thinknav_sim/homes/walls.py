"""Coordinates on a room's walls: `t` along the wall (world x or z), height, and depth into the room, metres."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from thinknav_sim.homes.doors import EAST, NORTH, SOUTH, WEST, Rect
from thinknav_sim.homes.mesh import Color, Floats, Mesh, Point, box, panel, quads

ROOM_HEIGHT_M = 2.6

# Where each side looks, into the room.
INWARD = {NORTH: (0.0, 1.0), WEST: (1.0, 0.0), SOUTH: (0.0, -1.0), EAST: (-1.0, 0.0)}


@dataclass(frozen=True)
class Wall:
    """One wall of a room, seen from inside."""

    side: int
    interior: Rect

    @property
    def along_x(self) -> bool:
        return self.side in (NORTH, SOUTH)

    @property
    def start(self) -> float:
        return self.interior[0] if self.along_x else self.interior[1]

    @property
    def end(self) -> float:
        return self.interior[2] if self.along_x else self.interior[3]

    @property
    def line(self) -> float:
        """Where the wall stands: z of a north or south wall, x of a west or east one."""
        return self.interior[{NORTH: 1, WEST: 0, SOUTH: 3, EAST: 2}[self.side]]

    @property
    def span(self) -> float:
        """How far the opposite wall is."""
        x0, z0, x1, z1 = self.interior
        return z1 - z0 if self.along_x else x1 - x0

    def points(self, places: ArrayLike) -> Floats:
        """World points of (..., 3) places (t, height, depth)."""
        array = np.asarray(places, dtype=np.float64)
        t, height, depth = array[..., 0], array[..., 1], array[..., 2]
        sign = 1.0 if self.side in (NORTH, WEST) else -1.0
        away = self.line + sign * depth
        return np.stack((t, height, away) if self.along_x else (away, height, t), axis=-1)

    def position(self, t: float, depth: float) -> tuple[float, float]:
        """World x and z of a place on the floor."""
        away = self.line + depth if self.side in (NORTH, WEST) else self.line - depth
        return (t, away) if self.along_x else (away, t)

    def quads(self, places: ArrayLike, colors: ArrayLike, toward: Point) -> Mesh:
        """Faces from (Q, 4, 3) corner places; see `mesh.quads`."""
        return quads(self.points(places), colors, toward)

    def box(self, along: Sequence[float], height: Sequence[float], depth: Sequence[float], color: Color) -> Mesh:
        """A box between two places: each argument gives low and high."""
        t0, t1 = along
        y0, y1 = height
        d0, d1 = depth
        size = (t1 - t0, y1 - y0, d1 - d0) if self.along_x else (d1 - d0, y1 - y0, t1 - t0)
        x, z = self.position((t0 + t1) / 2, (d0 + d1) / 2)
        return box((x, y0, z), size, color)

    def panel(self, along: Sequence[float], height: Sequence[float], thickness: float, color: Color) -> Mesh:
        """A flat piece on the wall, without back or bottom."""
        (t0, t1), (y0, y1) = along, height
        x, z = self.position((t0 + t1) / 2, thickness / 2)
        flat = panel((0, 0, 0), (t1 - t0, y1 - y0, thickness), color)
        return flat.quarter_turned(self.side).moved(x, y0, z)


def walls_of(interior: Rect) -> tuple[Wall, ...]:
    """The four walls of a room, in the order of their sides."""
    return tuple(Wall(side, interior) for side in (NORTH, WEST, SOUTH, EAST))
