"""An agent that knows the map: it walks the shortest way to the goal, turns to it, and stops.

Privileged: it reads the distance fields and lines of sight that the task judges by. For tests, demonstrations and
bounds.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation import distances_at
from thinknav_sim.navigation.descent import turns_towards_goal
from thinknav_sim.navigation.kinematics import advance
from thinknav_sim.success import at_viewpoint
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv


class ShortestPathFollower:
    """Actions for the envs of an `ObjectNavVectorEnv`, from their state alone: it keeps nothing between steps."""

    def __init__(self, env: ObjectNavVectorEnv) -> None:
        self.env = env
        self._turn = math.radians(env.config.turn_angle)

    def actions(self, indices: Sequence[int] | NDArray[np.int64] | None = None) -> NDArray[np.int64]:
        """The next action of some envs, all unless given: (n,) int64."""
        poses, episodes = self.env.poses, self.env.episode_indices
        agents = range(self.env.num_envs) if indices is None else indices
        return np.array([self._action(poses[i], int(episodes[i])) for i in agents], np.int64)

    def steps_needed(self, episode_index: int) -> int:
        """How many steps it takes from the episode's start, stop among them; max_steps where it does not get there."""
        world, config = self.env.world, self.env.config
        scene = world.table.scene[episode_index : episode_index + 1]
        pose = world.table.start[episode_index : episode_index + 1].copy()
        for steps in range(1, config.max_steps):
            action = self._action(pose[0], episode_index)
            if action == Action.STOP:
                return steps
            turn = {Action.TURN_LEFT: self._turn, Action.TURN_RIGHT: -self._turn}.get(action, 0.0)
            length = config.forward_step if action == Action.MOVE_FORWARD else 0.0
            advance(
                world.grids,
                scene,
                pose,
                np.zeros(1, np.int64),
                np.array([turn]),
                np.array([length]),
                config.allow_sliding,
                np.zeros(1),
                np.zeros(1, np.int64),
            )
        return config.max_steps

    def _action(self, pose: NDArray[np.float64], episode_index: int) -> Action:
        world, config = self.env.world, self.env.config
        scene = int(world.table.scene[episode_index])
        field = world.goal(scene, self.env.episodes[episode_index].object_category).distance
        if config.success == "viewpoint":
            if at_viewpoint(float(distances_at(world.grid(scene), field, pose[None])[0])):
                return Action.STOP
        else:
            bearings = world.goal_bearings(episode_index, pose)
            if bearings.size:
                nearest = float(bearings[np.abs(bearings).argmin()])
                if abs(nearest) <= math.radians(config.hfov) / 2:
                    return Action.STOP
                return Action.TURN_LEFT if nearest > 0 else Action.TURN_RIGHT
        turns = turns_towards_goal(
            world.grids, scene, field, pose, config.forward_step, self._turn, config.allow_sliding
        )
        if turns == 0:
            return Action.MOVE_FORWARD
        return Action.TURN_LEFT if turns > 0 else Action.TURN_RIGHT
