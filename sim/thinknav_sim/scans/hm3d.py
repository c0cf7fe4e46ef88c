"""HM3D scenes as they lie on disk: `X.basis.glb` to draw, `X.semantic.glb` painted by object, `X.semantic.txt`.

The text file names each colour: `313,23694C,"refrigerator cabinet",9` is object 313, painted 23694C, in region 9.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from thinknav_sim.scans.frame import Frame
from thinknav_sim.scans.glb_mesh import read_glb
from thinknav_sim.scans.labels import category_of
from thinknav_sim.scans.mesh import Mesh, checked, texel_colors
from thinknav_sim.scene import Box, ObjectInstance, SceneError

_HEADER = "HM3D Semantic Annotations"
# A triangle has the label of the nearest painted one, if that is at most this far.
_REACH_M = 0.25
# Both meshes are cut into different triangles; these points of each, in barycentric weights, are compared.
_PROBES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])


@dataclass(frozen=True)
class Annotation:
    """One row: the colour (3 bytes as one number) of an object and its category."""

    color: int
    category: str | None


def read_annotations(path: Path) -> list[Annotation]:
    """The rows of a `.semantic.txt`. Raises SceneError."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{path} cannot be read: {error}") from None
    if not lines or not lines[0].startswith(_HEADER):
        raise SceneError(f"{path} does not begin with {_HEADER!r}")
    rows = []
    for number, row in enumerate(csv.reader(lines[1:]), start=2):
        if not row:
            continue
        try:
            rows.append(Annotation(int(row[1], 16), category_of(row[2])))
        except (IndexError, ValueError):
            raise SceneError(f'{path}, line {number}: expected id,colour,"name",region, not {row}') from None
    return rows


def annotated_objects(
    mesh: Mesh, semantic_glb: Path, frame: Frame
) -> tuple[tuple[ObjectInstance, ...], NDArray[np.int32]]:
    """The objects of an HM3D scene and the object of each triangle (T,) of its mesh, which is in metres, y up.

    Objects of which the mesh has no triangle are left out. Raises SceneError where the files do not fit together.
    """
    annotations = read_annotations(semantic_glb.with_name(semantic_glb.name.removesuffix(".glb") + ".txt"))
    painted = frame.applied(checked(read_glb(semantic_glb), semantic_glb))
    by_color = {annotation.color: index for index, annotation in enumerate(annotations) if annotation.category}
    colors = _triangle_colors(painted).astype(np.int64) @ np.array([65536, 256, 1])
    known, inverse = np.unique(colors, return_inverse=True)
    rows = np.array([by_color.get(int(color), -1) for color in known], np.int64)[inverse]
    if annotations and (rows < 0).all() and by_color:
        raise SceneError(f"{semantic_glb} has none of the colours that its .semantic.txt names")
    apart, nearest = cKDTree(_probes(painted)).query(mesh.centroids(), distance_upper_bound=_REACH_M)
    found = np.where(np.isfinite(apart), np.append(np.tile(rows, len(_PROBES)), -1)[nearest], -1)
    objects: list[ObjectInstance] = []
    owners = np.full(len(mesh.triangles), -1, np.int32)
    corners = mesh.corners()
    for row in np.unique(found[found >= 0]):
        mine = found == row
        points = corners[mine].reshape(-1, 3)
        owners[mine] = len(objects)
        category = annotations[row].category
        assert category is not None
        objects.append(ObjectInstance(len(objects), category, Box(points.min(axis=0), points.max(axis=0))))
    return tuple(objects), owners


def _triangle_colors(mesh: Mesh) -> NDArray[np.uint8]:
    """(T, 3): the paint at the middle of each triangle; of its first corner where it has vertex colours."""
    colors = mesh.colors[mesh.triangles[:, 0]].copy()
    middle = mesh.uv[mesh.triangles].mean(axis=1)
    for index, texture in enumerate(mesh.textures):
        mine = mesh.triangle_textures == index
        colors[mine] = texel_colors(texture, middle[mine])
    return colors


def _probes(mesh: Mesh) -> NDArray[np.float64]:
    """(4 T, 3): the probe points, all first ones, then all second ones, ..."""
    probes: NDArray[np.float64] = np.einsum("pc,tck->ptk", _PROBES, mesh.corners()).reshape(-1, 3)
    return probes
