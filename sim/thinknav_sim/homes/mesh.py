"""Triangle meshes with flat or round shading, and the few solids that furniture and rooms are made of.

Knows nothing of furniture, rooms or light: a mesh carries surface colours (sRGB, 0..1) and normals, and `lighting`
turns them into what a camera sees.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Color = tuple[float, float, float]
Point = tuple[float, float, float]
Floats = NDArray[np.float64]

# A face this low lies on the floor: nobody sees it.
ON_FLOOR_M = 0.021

_EXACT_QUARTERS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))  # cosine, sine


@dataclass(frozen=True)
class Mesh:
    """vertices (V, 3) metres, normals (V, 3) unit, colors (V, 3) in 0..1, triangles (T, 3) int32."""

    vertices: Floats
    normals: Floats
    colors: Floats
    triangles: NDArray[np.int32]

    @property
    def low(self) -> Floats:
        """The lowest corner of the box around the mesh, (3,)."""
        corner: Floats = self.vertices.min(axis=0)
        return corner

    @property
    def high(self) -> Floats:
        """The highest corner of the box around the mesh, (3,)."""
        corner: Floats = self.vertices.max(axis=0)
        return corner

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> "Mesh":
        return replace(self, vertices=self.vertices + np.array((x, y, z)))

    def turned(self, angle: float) -> "Mesh":
        """Turned about the vertical axis through the origin: +z goes towards +x for a positive angle (radians)."""
        return self._rotated(math.cos(angle), math.sin(angle))

    def quarter_turned(self, quarters: int) -> "Mesh":
        """Turned by whole quarters, exactly: +z goes to +z, +x, -z, -x for 0, 1, 2, 3."""
        return self._rotated(*_EXACT_QUARTERS[quarters % 4])

    def _rotated(self, cosine: float, sine: float) -> "Mesh":
        return replace(
            self,
            vertices=_rotate(self.vertices, cosine, sine),
            normals=_rotate(self.normals, cosine, sine),
        )


def _rotate(points: Floats, cosine: float, sine: float) -> Floats:
    x, y, z = points.T
    return np.stack((x * cosine + z * sine, y, z * cosine - x * sine), axis=1)


def join(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of many; at least one."""
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.colors for mesh in meshes]),
        np.concatenate([mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)], dtype=np.int32),
    )


def _unit(vectors: Floats) -> Floats:
    squared = vectors * vectors
    length = np.sqrt(squared[:, 0] + squared[:, 1] + squared[:, 2])
    unit: Floats = vectors / np.where(length > 0, length, 1.0)[:, None]
    return unit


def quads(corners: ArrayLike, colors: ArrayLike, toward: Point | None = None) -> Mesh:
    """Flat four-cornered faces.

    corners: (Q, 4, 3), around each face. colors: one colour, one for each face (Q, 3), or each corner (Q, 4, 3).
    toward: a point that the faces look at; without it their normals follow the right-hand rule.
    """
    points = np.asarray(corners, dtype=np.float64)
    count = len(points)
    along, up = points[:, 1] - points[:, 0], points[:, 3] - points[:, 0]
    normals = _unit(
        np.stack(
            (
                along[:, 1] * up[:, 2] - along[:, 2] * up[:, 1],
                along[:, 2] * up[:, 0] - along[:, 0] * up[:, 2],
                along[:, 0] * up[:, 1] - along[:, 1] * up[:, 0],
            ),
            axis=1,
        )
    )
    if toward is not None:
        product = normals * (np.array(toward) - points[:, 0])
        normals = np.where((product[:, 0] + product[:, 1] + product[:, 2])[:, None] < 0, -normals, normals)
    shades = np.asarray(colors, dtype=np.float64)
    if shades.shape == (count, 3):
        shades = shades[:, None, :]
    first = 4 * np.arange(count, dtype=np.int32)[:, None]
    return Mesh(
        points.reshape(-1, 3),
        np.repeat(normals, 4, axis=0),
        np.broadcast_to(shades, (count, 4, 3)).reshape(-1, 3),
        (first + np.array((0, 1, 2, 0, 2, 3), dtype=np.int32)).reshape(-1, 3),
    )


def grid(us: ArrayLike, vs: ArrayLike) -> Floats:
    """The cells of a grid as (Q, 4, 2) corners, row by row in v."""
    u, v = np.asarray(us, dtype=np.float64), np.asarray(vs, dtype=np.float64)
    u0, v0 = (axis.ravel() for axis in np.meshgrid(u[:-1], v[:-1]))
    u1, v1 = (axis.ravel() for axis in np.meshgrid(u[1:], v[1:]))
    corners = np.stack((u0, v0, u1, v0, u1, v1, u0, v1), axis=1)
    return corners.reshape(-1, 4, 2)


# Around each face of the unit cube: x middle, y bottom, z middle at the origin; the bottom face last.
_CUBE = np.array(
    [
        [(-0.5, 0, 0.5), (0.5, 0, 0.5), (0.5, 1, 0.5), (-0.5, 1, 0.5)],
        [(0.5, 0, -0.5), (-0.5, 0, -0.5), (-0.5, 1, -0.5), (0.5, 1, -0.5)],
        [(0.5, 0, 0.5), (0.5, 0, -0.5), (0.5, 1, -0.5), (0.5, 1, 0.5)],
        [(-0.5, 0, -0.5), (-0.5, 0, 0.5), (-0.5, 1, 0.5), (-0.5, 1, -0.5)],
        [(-0.5, 1, 0.5), (0.5, 1, 0.5), (0.5, 1, -0.5), (-0.5, 1, -0.5)],
        [(-0.5, 0, -0.5), (0.5, 0, -0.5), (0.5, 0, 0.5), (-0.5, 0, 0.5)],
    ],
    dtype=np.float64,
)


def box(base: Point, size: Point, color: Color) -> Mesh:
    """A box. base: the middle of its bottom face; size: width, height, depth along x, y, z."""
    faces = _CUBE[:5] if base[1] <= ON_FLOOR_M else _CUBE
    return quads(faces * np.array(size) + np.array(base), color)


def panel(base: Point, size: Point, color: Color) -> Mesh:
    """A box without back and bottom, for what stands against something: doors, drawers, handles, books."""
    return quads(_CUBE[[0, 2, 3, 4]] * np.array(size) + np.array(base), color)


def cushion(base: Point, size: Point, color: Color, bevel: float = 0.04) -> Mesh:
    """A box whose upper edges are cut off, without a bottom since it lies on something: cushions, mattresses, pillows.

    Arguments as for `box`.
    """
    width, height, depth = size
    rim = np.array((width, height - bevel, depth))
    lower = _CUBE[:5] * rim
    inset = np.array((1 - 2 * bevel / width, 1.0, 1 - 2 * bevel / depth))
    upper = _CUBE[:5] * np.array((width, bevel, depth)) + np.array((0.0, height - bevel, 0.0))
    raised = upper[:, :, 1:2] > height - bevel / 2
    upper = np.where(raised, upper * inset, upper)
    return quads(np.concatenate((lower[:4], upper)) + np.array(base), color)


def rod(start: Point, end: Point, thickness: float, color: Color) -> Mesh:
    """A square bar between two points, without end faces: slanted legs, stems, arms of lamps."""
    a, b = np.array(start), np.array(end)
    direction = b - a
    flat = abs(direction[1]) < abs(direction[0]) + abs(direction[2])
    side = np.array((-direction[2], 0.0, direction[0])) if flat else np.array((1.0, 0.0, 0.0))
    other = np.array((0.0, 1.0, 0.0)) if flat else np.array((0.0, 0.0, 1.0))
    half = thickness / 2
    first, second = _unit(side[None])[0] * half, other * half
    ring = np.array((first + second, second - first, -first - second, first - second))
    following = np.roll(ring, -1, axis=0)
    faces = np.stack((a + ring, a + following, b + following, b + ring), axis=1)
    middle = (a + b) / 2
    solid = quads(faces, color, toward=(float(middle[0]), float(middle[1]), float(middle[2])))
    return replace(solid, normals=-solid.normals)


def revolve(
    base: Point,
    profile: Sequence[tuple[float, float]],
    color: Color,
    segments: int = 10,
    squash: tuple[float, float] = (1.0, 1.0),
) -> Mesh:
    """A turned solid: a profile of (radius, height) from bottom to top, swept about the vertical axis through base.

    squash scales the round cross-section along x and z (an oval bowl). A radius of 0 closes the solid.
    """
    turns = [2 * math.pi * step / segments for step in range(segments)]
    circle = np.array([(math.cos(turn), math.sin(turn)) for turn in turns])
    parts = [_band(circle, lower, upper, squash) for lower, upper in itertools.pairwise(profile)]
    offsets = 2 * segments * np.arange(len(parts))
    vertices = np.concatenate([part[0] for part in parts]) + np.array(base)
    return Mesh(
        vertices,
        np.concatenate([part[1] for part in parts]),
        np.tile(np.array(color), (len(vertices), 1)),
        np.concatenate([part[2] + offset for part, offset in zip(parts, offsets, strict=True)], dtype=np.int32),
    )


def _band(
    circle: Floats, lower: tuple[float, float], upper: tuple[float, float], squash: tuple[float, float]
) -> tuple[Floats, Floats, NDArray[np.int32]]:
    (r0, y0), (r1, y1) = lower, upper
    count = len(circle)
    x, z = circle[:, 0] * squash[0], circle[:, 1] * squash[1]
    rings = [np.stack((x * r, np.full(count, y), z * r), axis=1) for r, y in (lower, upper)]
    slope = np.full(count, r0 - r1)
    normals = _unit(np.stack((circle[:, 0] * (y1 - y0), slope, circle[:, 1] * (y1 - y0)), axis=1))
    this = np.arange(count)
    following = (this + 1) % count
    triangles = []
    if r0 > 0:
        triangles.append(np.stack((this, this + count, following), axis=1))
    if r1 > 0:
        triangles.append(np.stack((following, this + count, following + count), axis=1))
    return np.concatenate(rings), np.concatenate((normals, normals)), np.concatenate(triangles).astype(np.int32)


def cylinder(base: Point, radius: float, height: float, color: Color, segments: int = 10) -> Mesh:
    """An upright cylinder, closed on top."""
    return revolve(base, ((radius, 0.0), (radius, height), (0.0, height)), color, segments)


def ellipsoid(center: Point, radii: Point, color: Color, segments: int = 7) -> Mesh:
    """A coarse ellipsoid of four bands: foliage, fruit, lamps."""
    rings = ((0.0, -1.0), (0.8, -0.6), (1.0, 0.05), (0.75, 0.66), (0.0, 1.0))
    profile = [(radius, height * radii[1]) for radius, height in rings]
    return revolve(center, profile, color, segments, (radii[0], radii[2]))


def leaf(start: Point, tip: Point, width: float, color: Color) -> Mesh:
    """A pointed leaf from its stalk to its tip: two triangles, widest past the middle, a little raised there."""
    a, b = np.array(start), np.array(tip)
    along = b - a
    side = _unit(np.array(((along[2], 0.0, -along[0]),)))[0]
    if along[0] == 0 and along[2] == 0:
        side = np.array((1.0, 0.0, 0.0))
    middle = a + along * 0.55
    middle[1] += 0.12 * abs(along[0]) + 0.12 * abs(along[2])
    corners = np.array([(a, middle - side * width / 2, b, middle + side * width / 2)])
    light = np.array(color)
    shades = np.array([(light * 0.75, light, light * 1.08, light * 0.9)])
    return quads(corners, shades, toward=(float(a[0]), 10.0, float(a[2])))
