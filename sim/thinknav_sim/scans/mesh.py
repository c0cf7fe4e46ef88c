"""A mesh as a file holds it: triangles with colours or textures, before it is turned upright, measured and named.

Knows nothing of files, units or objects.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scene import SceneError

# What a mesh without any colour is drawn in: unpainted plaster.
PLAIN = (214, 208, 198)
# Far beyond a home in millimetres, and far below where its square or a triangle's area is no number any more.
_MAX_SIZE = 1e12


@dataclass(frozen=True)
class Mesh:
    """Triangles and how they look.

    vertices: (V, 3) float64, in the file's units and axes. triangles: (T, 3) int32.
    colors: (V, 3) uint8 sRGB. painted: whether the file gave them; a mesh of one colour shows no shapes until shaded.
    textures, uv, triangle_textures: as in Scene.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]
    colors: NDArray[np.uint8]
    painted: bool
    textures: tuple[NDArray[np.uint8], ...]
    uv: NDArray[np.float32]
    triangle_textures: NDArray[np.int32]

    @classmethod
    def joined(cls, parts: Sequence["Mesh"]) -> "Mesh":
        """All parts in one; each brings its own textures."""
        if not parts:
            empty = np.empty((0, 3))
            return cls(
                empty,
                empty.astype(np.int32),
                empty.astype(np.uint8),
                False,
                (),
                np.empty((0, 2), np.float32),
                np.empty(0, np.int32),
            )
        first_vertex = np.cumsum([0] + [len(part.vertices) for part in parts])
        first_texture = np.cumsum([0] + [len(part.textures) for part in parts])
        return cls(
            vertices=np.concatenate([part.vertices for part in parts]),
            triangles=np.concatenate(
                [part.triangles + np.int32(first) for part, first in zip(parts, first_vertex, strict=False)]
            ),
            colors=np.concatenate([part.colors for part in parts]),
            painted=any(part.painted for part in parts),
            textures=tuple(texture for part in parts for texture in part.textures),
            uv=np.concatenate([part.uv for part in parts]),
            triangle_textures=np.concatenate(
                [
                    np.where(part.triangle_textures < 0, np.int32(-1), part.triangle_textures + np.int32(first))
                    for part, first in zip(parts, first_texture, strict=False)
                ]
            ),
        )

    def corners(self) -> NDArray[np.float64]:
        """(T, 3, 3) float64: the corners of each triangle."""
        return self.vertices[self.triangles]

    def centroids(self) -> NDArray[np.float64]:
        """(T, 3) float64."""
        middle: NDArray[np.float64] = self.corners().mean(axis=1)
        return middle

    def normals(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Unit normals (T, 3), zero where a triangle has no area, and areas (T,)."""
        corners = self.corners()
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(crossed, axis=1)
        return crossed / np.maximum(doubled, 1e-300)[:, None], doubled / 2

    def keeping(self, triangles: NDArray[np.bool_]) -> "Mesh":
        """Only these triangles (T,), and the vertices that they use."""
        used = np.zeros(len(self.vertices), np.bool_)
        used[self.triangles[triangles]] = True
        renumbered = np.cumsum(used, dtype=np.int32) - 1
        return replace(
            self,
            vertices=self.vertices[used],
            triangles=renumbered[self.triangles[triangles]].astype(np.int32),
            colors=self.colors[used],
            uv=self.uv[used],
            triangle_textures=self.triangle_textures[triangles],
        )


def checked(mesh: Mesh, source: object) -> Mesh:
    """The mesh without degenerate triangles. Raises SceneError, naming the source, where nothing usable is left."""
    if not len(mesh.triangles):
        raise SceneError(f"{source} holds no triangles; if a viewer shows some, export it again as GLB, uncompressed")
    if mesh.triangles.min() < 0 or mesh.triangles.max() >= len(mesh.vertices):
        raise SceneError(f"{source} has a triangle that names vertex {mesh.triangles.max()} of {len(mesh.vertices)}")
    broken = ~np.isfinite(mesh.vertices).all(axis=1)
    if broken.any():
        raise SceneError(
            f"{source} has {int(broken.sum())} vertices that are NaN or infinite, the first at {broken.argmax()}; "
            "export it again or repair it"
        )
    size = float(np.ptp(mesh.vertices, axis=0).max())
    if size > _MAX_SIZE:
        raise SceneError(f"{source} is {size:.3g} wide in its own units, which no home is in any")
    areas = mesh.normals()[1]
    # Relative to the scene: a sliver of no width is one in any unit.
    solid = areas > 1e-14 * size**2
    if not solid.any():
        raise SceneError(f"{source} has {len(areas)} triangles, all of them degenerate (without area)")
    # Vertices that no triangle uses go too: far away, they would make a home look as large as a town.
    return mesh.keeping(solid)


def texel_colors(texture: NDArray[np.uint8], uv: NDArray[np.float32] | NDArray[np.float64]) -> NDArray[np.uint8]:
    """The nearest texels (N, 3) at uv (N, 2), the texture repeating."""
    height, width = texture.shape[:2]
    wrapped = uv.astype(np.float64) % 1.0
    cols = np.minimum((wrapped[:, 0] * width).astype(np.int64), width - 1)
    rows = np.minimum((wrapped[:, 1] * height).astype(np.int64), height - 1)
    texels: NDArray[np.uint8] = texture[rows, cols]
    return texels


def shaded(mesh: Mesh) -> NDArray[np.uint8]:
    """(V, 3) uint8: the colours darkened by how each surface faces, so that a mesh of one colour shows its shapes.

    Either side of a triangle is lit alike: scans do not agree on which is the outside.
    """
    normals, areas = mesh.normals()
    facing = np.zeros((len(mesh.vertices), 3))
    for corner in range(3):
        np.add.at(facing, mesh.triangles[:, corner], np.abs(normals) * areas[:, None])
    facing /= np.maximum(np.linalg.norm(facing, axis=1), 1e-300)[:, None]
    light = 0.45 + facing**2 @ np.array([0.22, 0.55, 0.38])
    lit: NDArray[np.uint8] = np.clip(mesh.colors * light[:, None], 0, 255).astype(np.uint8)
    return lit
