"""A scene's textures as flat arrays, for compiled code that cannot take a tuple of images. Knows nothing of rays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scene import Scene


class PackedTextures(NamedTuple):
    """The textures of a scene, end to end; all empty where nothing is textured.

    corner_uv: (T, 3, 2) float32, the places of each triangle's corners on its texture.
    triangle_textures: (T,) int32, row of `sizes`, -1 for a triangle with vertex colours.
    sizes: (K, 3) int64, the texture's first texel, height and width.
    texels: (3 * all texels,) uint8, rows from the top.
    """

    corner_uv: NDArray[np.float32]
    triangle_textures: NDArray[np.int32]
    sizes: NDArray[np.int64]
    texels: NDArray[np.uint8]


def pack_textures(scene: Scene) -> PackedTextures:
    """Copies of a scene's textures, contiguous."""
    if scene.uv is None or scene.triangle_textures is None or not scene.textures:
        return PackedTextures(
            np.empty((0, 3, 2), np.float32), np.empty(0, np.int32), np.empty((0, 3), np.int64), np.empty(0, np.uint8)
        )
    shapes = np.array([texture.shape[:2] for texture in scene.textures], np.int64)
    firsts = np.cumsum(shapes.prod(axis=1)) - shapes.prod(axis=1)
    return PackedTextures(
        corner_uv=scene.uv[scene.triangles],
        triangle_textures=np.array(scene.triangle_textures, order="C"),
        sizes=np.column_stack([firsts, shapes]),
        texels=np.concatenate([texture.ravel() for texture in scene.textures]),
    )
