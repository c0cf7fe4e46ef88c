"""When an agent that stops has found its goal.

Two rules: the paper's (near by walking, facing the object, sight clear) and Habitat's (at a viewpoint). They know poses
and goals, nothing of episodes or rewards.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation import Goal, NavigationGrid
from thinknav_sim.navigation.kinematics import wrap
from thinknav_sim.navigation.visibility import sees_points
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene

# Habitat's ObjectNav: this near to a viewpoint is there.
VIEWPOINT_DISTANCE_M = 0.1


def goal_bearings(
    scene: Scene,
    grid: NavigationGrid,
    renderer: Renderer,
    scene_id: int,
    goal: Goal,
    pose: NDArray[np.float64],
    camera_height: float,
) -> NDArray[np.float64]:
    """Where, from the heading, the goal is to be seen by an agent that stands in its success zone.

    scene_id: the renderer's. pose: (4,).
    Returns (B,) radians in (-pi, pi], positive to the left: one for each surface point with a clear line of sight, of
    each object whose zone the agent stands in. Empty outside of the zones, or when nothing of the objects shows from
    there.
    """
    if not grid.is_navigable(pose[None])[0]:
        return np.empty(0)
    (row,), (col,) = grid.cells(pose[None])
    eye = pose[:3].copy()
    eye[1] += camera_height
    bearings = [np.empty(0)]
    for found in goal.objects:
        if found.zone[row, col]:
            object_id = found.instance.object_id
            (seen,) = sees_points(renderer, scene_id, scene.triangle_objects, eye[None], found.points, object_id)
            ahead = found.points[seen] - eye
            bearings.append(wrap(np.arctan2(-ahead[:, 0], -ahead[:, 2]) - pose[3]))
    return np.concatenate(bearings)


def faces_goal(bearings: NDArray[np.float64], hfov: float) -> bool:
    """The paper's rule, given `goal_bearings`: some of the goal lies within the horizontal field of view (degrees)."""
    return bool((np.abs(bearings) <= math.radians(hfov) / 2).any())


def at_viewpoint(distance_to_goal: float) -> bool:
    """Habitat's rule."""
    return distance_to_goal < VIEWPOINT_DISTANCE_M
