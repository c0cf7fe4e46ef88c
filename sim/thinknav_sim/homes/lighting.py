"""Light baked into vertex colours: daylight from a room's windows, ambient light, darker corners, soft contact shadows.

Cheap by design: no rays are cast. What faces the window is brighter, and so is what is near it; surfaces darken towards
the edges that they share with walls, floor and ceiling; the floor darkens around furniture.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.homes.doors import Rect, Window
from thinknav_sim.homes.mesh import Color, Floats, Mesh
from thinknav_sim.homes.walls import INWARD, ROOM_HEIGHT_M, walls_of

_AMBIENT = 0.68
_KEY = 0.34
_BOUNCE = 0.20  # what a lit floor gives back to ceilings and undersides
_GLOW = 0.16  # how much brighter it is right at a window
_GLOW_RADIUS_M = 1.6
_CORNER_DARKENING = 0.24
_CORNER_M = 0.55
_SHADOW = 0.42
_SHADOW_M = 0.3
_UNLIT = 1.0  # colours above this shine by themselves: the sky, lamps

_SLANT = (0.55, 0.80, 0.24)  # of the key light: towards the window, up, sideways


@dataclass(frozen=True)
class RoomLight:
    """The light of one room. tint: the colour of its ambient light; footprints: where furniture stands."""

    interior: Rect
    windows: tuple[Window, ...]
    tint: Color
    footprints: tuple[Rect, ...]

    def bake(self, mesh: Mesh) -> NDArray[np.uint8]:
        """The (V, 3) sRGB colours that a camera sees on the mesh."""
        light = self._daylight(mesh.normals) + self._glow(mesh.vertices)
        light *= self._corners(mesh.vertices, mesh.normals) * self._contact(mesh.vertices, mesh.normals)
        lit = mesh.colors * light[:, None] * np.array(self.tint)
        shining = mesh.colors.max(axis=1) > _UNLIT
        lit[shining] = mesh.colors[shining]
        colors: NDArray[np.uint8] = np.rint(np.clip(lit, 0.0, 1.0) * 255).astype(np.uint8)
        return colors

    def _daylight(self, normals: Floats) -> Floats:
        x, y, z = _direction(self.windows)
        facing = normals[:, 0] * x + normals[:, 1] * y + normals[:, 2] * z
        back = -(normals[:, 0] * x + normals[:, 2] * z)
        light: Floats = (
            _AMBIENT
            + _KEY * np.maximum(facing, 0)
            + 0.3 * _KEY * np.maximum(back, 0)
            + _BOUNCE * np.maximum(-normals[:, 1], 0)
        )
        return light

    def _glow(self, vertices: Floats) -> Floats:
        glow = np.zeros(len(vertices))
        walls = walls_of(self.interior)
        for window in self.windows:
            x, z = walls[window.side].position((window.start + window.end) / 2, 0.0)
            dx, dy, dz = vertices[:, 0] - x, vertices[:, 1] - 1.5, vertices[:, 2] - z
            squared = (dx * dx + dy * dy + dz * dz) / _GLOW_RADIUS_M**2
            glow = np.maximum(glow, _GLOW / (1 + squared))
        return glow

    def _corners(self, vertices: Floats, normals: Floats) -> Floats:
        """1 in the open, darker where the surface nears another one of the room; not for the one it lies in."""
        x0, z0, x1, z1 = self.interior
        factor = np.ones(len(vertices))
        for axis, low, high in ((0, x0, x1), (1, 0.0, ROOM_HEIGHT_M), (2, z0, z1)):
            distance = np.minimum(vertices[:, axis] - low, high - vertices[:, axis])
            near = np.clip(1 - distance / _CORNER_M, 0.0, 1.0)
            factor *= 1 - _CORNER_DARKENING * near * near * (1 - np.abs(normals[:, axis]))
        return factor

    def _contact(self, vertices: Floats, normals: Floats) -> Floats:
        """Shadows on the floor (and rugs) under and around furniture."""
        factor = np.ones(len(vertices))
        floor = np.flatnonzero((vertices[:, 1] < 0.02) & (normals[:, 1] > 0.9))
        x, z = vertices[floor, 0], vertices[floor, 2]
        shadow = np.zeros(len(floor))
        for x0, z0, x1, z1 in self.footprints:
            away_x = np.maximum(np.maximum(x0 - x, x - x1), 0)
            away_z = np.maximum(np.maximum(z0 - z, z - z1), 0)
            shadow = np.maximum(shadow, 1 - (away_x + away_z) / _SHADOW_M)
        factor[floor] = 1 - _SHADOW * shadow
        return factor


def _direction(windows: Sequence[Window]) -> Color:
    """Unit vector towards the light: through the first window, or from above when there is none."""
    along, up, aside = _SLANT
    if not windows:
        return (aside, up, along)
    x, z = INWARD[windows[0].side]
    return (-x * along + z * aside, up, -z * along + x * aside)
