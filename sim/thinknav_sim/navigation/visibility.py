"""What can be seen of an object, and from where: rays from eyes to points on its surface.

An object is seen from a point when a ray from there to one of its surface points meets that object first.
"""

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.renderer import Renderer
from thinknav_sim.scene import Scene

# Points spread over an object's surface to look at: enough that one of them shows where any good part does.
SURFACE_POINTS = 16


def surface_points(scene: Scene, object_id: int, count: int = SURFACE_POINTS) -> NDArray[np.float64]:
    """(count, 3) points spread evenly over the area of an object's triangles, always the same ones.

    (0, 3) for an object of which the scene has no triangles: nobody can see it.
    """
    corners = scene.triangles_of(object_id).astype(np.float64)
    if not len(corners):
        return np.empty((0, 3))
    edges = corners[:, 1:] - corners[:, :1]
    covered = np.cumsum(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1))
    order = (np.arange(count) + 0.5) / count
    picks = np.minimum(np.searchsorted(covered, order * covered[-1]), len(corners) - 1)
    # The additive recurrence of the plastic number spreads points evenly in the unit square (Roberts' R2 sequence).
    u, v = np.modf(0.5 + np.outer([0.7548776662466927, 0.5698402909980532], np.arange(1, count + 1)))[0]
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
    points: NDArray[np.float64] = corners[picks, 0] + u[:, None] * edges[picks, 0] + v[:, None] * edges[picks, 1]
    return points


def sees_points(
    renderer: Renderer,
    scene_id: int,
    triangle_objects: NDArray[np.int32],
    eyes: NDArray[np.float64],
    points: NDArray[np.float64],
    object_id: int,
) -> NDArray[np.bool_]:
    """Which of an object's surface points have a clear line of sight.

    scene_id: the renderer's. eyes: (E, 3). points: (P, 3) on the object. Returns (E, P) bool.
    """
    if not len(eyes) or not len(points):
        return np.zeros((len(eyes), len(points)), np.bool_)
    origins = np.repeat(eyes, len(points), axis=0)
    directions = np.tile(points, (len(eyes), 1)) - origins
    hits = renderer.cast(scene_id, origins.astype(np.float32), directions.astype(np.float32))
    seen: NDArray[np.bool_] = (hits.triangle >= 0) & (triangle_objects[hits.triangle] == object_id)
    return seen.reshape(len(eyes), len(points))
