"""What can be said of an episode once it is over, by one who knows the map: privileged, and told to no agent.

When the goal was in view, whether stopping counted by either rule, how long the way was, and why it failed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.follower import ShortestPathFollower
from thinknav_sim.navigation import Goal, distances_at
from thinknav_sim.navigation.visibility import sees_points
from thinknav_sim.success import at_viewpoint, faces_goal
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.failures import Trace, failure_cause

# A goal is in view where this share of the points on its surface is: half of a surface faces away at any time.
SEEN_SHARE = 1 / 8


@dataclass(frozen=True)
class Testimony:
    """success_paper, success_viewpoint: 1 if it stopped where that rule wants it. steps_needed: by the shortest way.

    first_seen: the first step at which the goal was in view, none if it never was. failure: none for a success.
    """

    success_paper: float
    success_viewpoint: float
    steps_needed: int
    first_seen: int | None
    failure: str | None


class Witness:
    """Looks into the world of an env; the ways that it has measured are kept."""

    def __init__(self, env: ObjectNavVectorEnv) -> None:
        self._env = env
        self._follower = ShortestPathFollower(env)

    def testify(
        self, episode_index: int, path: Sequence[Sequence[float]], actions: Sequence[int], success: bool
    ) -> Testimony:
        """What happened in an episode. path: the pose (4,) before each of the actions."""
        poses = np.array(path, np.float64)
        world, config = self._env.world, self._env.config
        scene = int(world.table.scene[episode_index])
        goal = world.goal(scene, self._env.episodes[episode_index].object_category)
        distances = distances_at(world.grid(scene), goal.distance, poses)
        seen = self._seen(scene, goal, poses)
        bearings = world.goal_bearings(episode_index, poses[-1])
        stopped = actions[-1] == Action.STOP
        near = config.success == "paper" and _in_zone(world.grid(scene).cells(poses[-1:]), goal)
        trace = Trace(poses, np.array(actions, np.int64), distances, seen, near)
        return Testimony(
            success_paper=float(stopped and faces_goal(bearings, config.hfov)),
            success_viewpoint=float(stopped and at_viewpoint(float(distances[-1]))),
            steps_needed=self._follower.steps_needed(episode_index),
            first_seen=int(seen.argmax()) if seen.any() else None,
            failure=None if success else str(failure_cause(trace)),
        )

    def _seen(self, scene: int, goal: Goal, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """At which of the poses (T, 4) an object of the goal was in view."""
        world, config = self._env.world, self._env.config
        prepared = world.prepared[scene]
        places, which = np.unique(poses, axis=0, return_inverse=True)
        eyes = places[:, :3] + np.array([0.0, config.camera_height, 0.0])
        seen = np.zeros(len(places), np.bool_)
        for found in goal.objects:
            framed = in_frame(eyes, places[:, 3], found.points, config)
            needed = SEEN_SHARE * len(found.points)
            worth = np.flatnonzero(framed.sum(axis=1) >= needed)
            object_id = found.instance.object_id
            clear = sees_points(
                world.renderer, prepared.scene_id, prepared.scene.triangle_objects, eyes[worth], found.points, object_id
            )
            seen[worth] |= (clear & framed[worth]).sum(axis=1) >= needed
        in_view: NDArray[np.bool_] = seen[which.reshape(-1)]
        return in_view


def in_frame(
    eyes: NDArray[np.float64], headings: NDArray[np.float64], points: NDArray[np.float64], config: ObjectNavConfig
) -> NDArray[np.bool_]:
    """Which points (P, 3) lie in the picture of which eyes (E, 3), headings (E,), were nothing in between: (E, P).

    Beyond the reach of the depth sensor nothing does.
    """
    apart = points[None] - eyes[:, None]
    sine, cosine = np.sin(headings)[:, None], np.cos(headings)[:, None]
    ahead = -sine * apart[..., 0] - cosine * apart[..., 2]
    aside = cosine * apart[..., 0] - sine * apart[..., 2]
    width = math.tan(math.radians(config.hfov) / 2)
    height = width * config.height / config.width
    framed: NDArray[np.bool_] = (
        (ahead > 0)
        & (ahead <= config.max_depth)
        & (np.abs(aside) <= width * ahead)
        & (np.abs(apart[..., 1]) <= height * ahead)
    )
    return framed


def _in_zone(cell: tuple[NDArray[np.int64], NDArray[np.int64]], goal: Goal) -> bool:
    (row,), (col,) = cell
    rows, cols = goal.zone.shape
    return bool(0 <= row < rows and 0 <= col < cols and goal.zone[row, col])
