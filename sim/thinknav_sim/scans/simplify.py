"""Fewer triangles: quadric decimation (Garland and Heckbert 1997, Open3D's), and fragments that float in the air.

Decimation cannot carry textures over; their colours stay, baked into the vertices.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from thinknav_sim.render import Renderer
from thinknav_sim.sampling import points_on
from thinknav_sim.scans.mesh import Mesh
from thinknav_sim.scene import Scene

# Vertices closer than this are one: texture seams split them.
_WELD_M = 1e-4
# A fragment smaller than this that nothing touches within `_AIR_M` is a flaw of the scan.
_FRAGMENT_M = 0.3
_AIR_M = 0.08
_SKIN_M = 1e-3
# What touches a fragment is found where it is no thinner than this.
_THIN_M = 0.01


def decimated(mesh: Mesh, count: int) -> Mesh:
    """The mesh with about `count` triangles, in vertex colours. Metres."""
    import open3d as o3d

    welded = _welded(mesh)
    _, first = np.unique(welded, return_index=True)
    vertices = mesh.vertices[first]
    solid = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(welded[mesh.triangles])
    )
    simple = solid.simplify_quadric_decimation(target_number_of_triangles=count)
    simple.remove_degenerate_triangles()
    kept, triangles = np.asarray(simple.vertices), np.asarray(simple.triangles).astype(np.int32)
    colors = mesh.colors[cKDTree(mesh.vertices).query(kept)[1]]
    return Mesh(
        kept.astype(np.float64),
        triangles,
        colors,
        mesh.painted,
        (),
        np.zeros((len(kept), 2), np.float32),
        np.full(len(triangles), -1, np.int32),
    )


def fragments(mesh: Mesh, scene: Scene, renderer: Renderer) -> NDArray[np.bool_]:
    """Which triangles (T,) belong to small pieces that float free of everything else. scene: of the same triangles."""
    welded = _welded(mesh)[mesh.triangles]
    edges = np.concatenate([welded[:, :2], welded[:, 1:]])
    count = int(welded.max()) + 1
    pieces, of_vertex = connected_components(coo_matrix((np.ones(len(edges)), edges.T), (count, count)), directed=False)
    of_triangle = of_vertex[welded[:, 0]]
    corners = mesh.corners()
    low, high = np.full((pieces, 3), np.inf), np.full((pieces, 3), -np.inf)
    np.minimum.at(low, of_triangle, corners.min(axis=1))
    np.maximum.at(high, of_triangle, corners.max(axis=1))
    small = np.linalg.norm(high - low, axis=1) < _FRAGMENT_M
    if small.all():
        return np.zeros(len(mesh.triangles), np.bool_)
    # What touches the solid part is solid, then what touches that: a book on a book on a table.
    while small.any():
        touching = _touching(corners, small[of_triangle], of_triangle, scene, renderer)
        if not len(touching):
            break
        small[touching] = False
    lost: NDArray[np.bool_] = small[of_triangle]
    return lost


def _touching(
    corners: NDArray[np.float64],
    loose: NDArray[np.bool_],
    pieces: NDArray[np.int32],
    scene: Scene,
    renderer: Renderer,
) -> NDArray[np.int32]:
    """The loose pieces that come near to a triangle that is not loose: rays along the axes from all over them."""
    solid = replace(
        scene,
        triangles=scene.triangles[~loose],
        triangle_objects=scene.triangle_objects[~loose],
        textures=(),
        uv=None,
        triangle_textures=None,
    )
    places, triangles = points_on(corners[loose], _THIN_M)
    points = np.repeat(places, 6, axis=0)
    rays = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (len(places), 1))
    scene_id = renderer.add_scene(solid)
    try:
        # From a little behind, so that what lies exactly on a surface meets it.
        hits = renderer.cast(scene_id, (points - _SKIN_M * rays).astype(np.float32), rays.astype(np.float32))
    finally:
        renderer.remove_scene(scene_id)
    near = (hits.triangle >= 0) & (hits.distance <= _AIR_M)
    return np.unique(np.repeat(pieces[loose][triangles], 6)[near])


def _welded(mesh: Mesh) -> NDArray[np.int32]:
    """(V,) the number of the place that each vertex is at."""
    _, places = np.unique(np.rint(mesh.vertices / _WELD_M).astype(np.int64), axis=0, return_inverse=True)
    return places.ravel().astype(np.int32)
