"""A scene cut into clusters: triangles that lie together, in blocks of one size for vector instructions.

Knows nothing of views: `raster_kernels` decides which clusters a view needs.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.textures import pack_textures
from thinknav_sim.scene import Scene

# Triangles in a cluster. Fewer are culled more sharply, and cost more to look at.
CLUSTER = 32
# Clusters in a block. They lie together: most blocks are out of the picture, and so are their clusters.
BLOCK = 16
# Triangles with a longer side, metres, make clusters of their own: they would blow up the boxes of small ones.
_LONG_M = 1.0


class Clusters(NamedTuple):
    """K clusters of CLUSTER triangles each; the last places of a cluster may be empty: triangles of no area.

    blocks: (K / BLOCK rounded up, 6) float32, the low and the high corner of each BLOCK clusters in a row.
    boxes: (K, 6) float32, the same of each cluster.
    corners: (K, 9, CLUSTER) float32, x, y, z of corner 0, then of 1 and 2, of each triangle.
    colors: (K * CLUSTER, 9) uint8, red, green, blue of corner 0, then of 1 and 2.
    corner_uv: (K * CLUSTER, 6) float32, places on the texture. triangle_textures: (K * CLUSTER,) int32, row of `sizes`
    or -1. sizes, texels: see `PackedTextures`. The last four are empty where nothing is textured.
    """

    blocks: NDArray[np.float32]
    boxes: NDArray[np.float32]
    corners: NDArray[np.float32]
    colors: NDArray[np.uint8]
    corner_uv: NDArray[np.float32]
    triangle_textures: NDArray[np.int32]
    sizes: NDArray[np.int64]
    texels: NDArray[np.uint8]

    @property
    def kernel_row(self) -> list[int]:
        """Addresses and lengths of the arrays, in the order in which `raster_kernels.draw_views` takes them."""
        return [number for array in self for number in (array.ctypes.data, len(array))]


def cluster(scene: Scene) -> Clusters:
    """Copies of a scene's triangles in clusters. The same scene gives the same clusters on every machine."""
    corners = scene.vertices[scene.triangles]
    places = _places(corners)
    filled = places >= 0
    chosen = corners[places] * filled[..., None, None].astype(np.float32)
    low = np.where(filled[..., None], corners.min(axis=1)[places], np.inf).min(axis=1)
    high = np.where(filled[..., None], corners.max(axis=1)[places], -np.inf).max(axis=1)
    starts = np.arange(0, len(places), BLOCK)
    block_low, block_high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
    flat = places.ravel()
    packed = pack_textures(scene)
    textured = len(packed.sizes) > 0
    return Clusters(
        blocks=np.concatenate([block_low, block_high], axis=1).astype(np.float32),
        boxes=np.concatenate([low, high], axis=1).astype(np.float32),
        corners=np.ascontiguousarray(chosen.reshape(len(places), CLUSTER, 9).transpose(0, 2, 1)),
        colors=scene.colors[scene.triangles[flat]].reshape(-1, 9),
        corner_uv=packed.corner_uv[flat].reshape(-1, 6) if textured else np.empty((0, 6), np.float32),
        triangle_textures=packed.triangle_textures[flat] if textured else np.empty(0, np.int32),
        sizes=packed.sizes,
        texels=packed.texels,
    )


def _places(corners: NDArray[np.float32]) -> NDArray[np.int64]:
    """The triangle at each place of each cluster, -1 at empty places: (K, CLUSTER)."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    long = (high - low).max(axis=1) > _LONG_M
    middles = (low + high) / 2
    groups: list[NDArray[np.int64]] = []
    for chosen in (np.flatnonzero(long), np.flatnonzero(~long)):
        _split(middles, chosen, groups)
    places = np.full((len(groups), CLUSTER), -1, np.int64)
    for row, group in zip(places, groups, strict=True):
        row[: len(group)] = group
    return places


def _split(middles: NDArray[np.float32], chosen: NDArray[np.int64], groups: list[NDArray[np.int64]]) -> None:
    """Halve the chosen triangles along the longest side of their middles' box until each group fits a cluster."""
    if len(chosen) <= CLUSTER:
        if len(chosen):
            groups.append(chosen)
        return
    points = middles[chosen]
    axis = int(np.argmax(np.ptp(points, axis=0)))
    # Whole clusters to the left, so that only a last one has empty places.
    half = CLUSTER * (-(-len(chosen) // CLUSTER) // 2)
    order = np.argsort(points[:, axis], kind="stable")
    _split(middles, chosen[order[:half]], groups)
    _split(middles, chosen[order[half:]], groups)
