"""A teacher that knows the map of a home: from any pose, the way to each of the goals.

It is what the subgoal VLM learns from and is judged against; nothing of it is there when the VLM plans.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thinknav_sim.navigation import Goal, GridTable, NavigationGrid, find_goal
from thinknav_sim.navigation.descent import turns_towards_goal
from thinknav_sim.navigation.geodesic import bilinear, steepest_descent
from thinknav_sim.navigation.kinematics import walk
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import Renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene, SceneError
from thinknav_sim.success import goal_bearings
from thinknav_sim.task_config import Action, ObjectNavConfig

NO_WAY = -1

# Forward is right while it brings an agent at least this share of what the best heading would; one turn beside it.
_GOOD_ENOUGH = 0.5


@dataclass(frozen=True)
class Ways:
    """The ways from N poses to G goals each, all (N, G).

    actions: int8, the Action that a guide would call for; NO_WAY where the goal cannot be reached.
    bearings: float32 radians, left positive, of the way's first step, or of the goal where one stands before it.
    distances: float32 metres to the success zone, inf without a way.
    """

    actions: NDArray[np.int8]
    bearings: NDArray[np.float32]
    distances: NDArray[np.float32]


class HomeTeacher:
    """Knows one scene; `close` takes it out of the renderer."""

    def __init__(self, scene: Scene, renderer: Renderer, task: ObjectNavConfig) -> None:
        """Raises SceneError for a scene without a way to any goal."""
        self.scene, self.renderer, self.task = scene, renderer, task
        self.grid: NavigationGrid = make_grid(scene, renderer, task)
        self.scene_id = renderer.add_scene(scene)
        self.goals: tuple[Goal, ...] = tuple(
            find_goal(
                scene,
                self.grid,
                renderer,
                self.scene_id,
                category,
                success_distance=task.success_distance,
                camera_height=task.camera_height,
            )
            for category in GOAL_CATEGORIES
        )
        self.table = GridTable.of([self.grid])
        self.fields = np.stack([goal.distance for goal in self.goals])
        if not self.reachable:
            raise SceneError(f"in {scene.name} there is no way to any of {', '.join(GOAL_CATEGORIES)}: nothing to ask")

    @property
    def reachable(self) -> list[int]:
        """Indices of the goals that there is a way to."""
        return [index for index, goal in enumerate(self.goals) if goal.objects]

    def ways(self, poses: NDArray[np.float64], goals: NDArray[np.int64]) -> Ways:
        """What a guide would say in N poses (N, 4) about goals (N, G), indices into GOAL_CATEGORIES."""
        turn = math.radians(self.task.turn_angle)
        turns, gains, distances = _turns(self.table, self.fields, poses, goals, self.task.forward_step, turn)
        ahead = (np.abs(turns) <= 1) & (gains >= _GOOD_ENOUGH)
        actions = np.where(turns > 0, Action.TURN_LEFT, Action.TURN_RIGHT).astype(np.int8)
        actions[ahead] = Action.MOVE_FORWARD
        actions[~np.isfinite(distances)] = NO_WAY
        ways = Ways(actions, (turns * turn).astype(np.float32), distances.astype(np.float32))
        zones = np.stack([goal.zone for goal in self.goals])
        rows, cols = self.grid.cells(poses)
        for pose, column in np.argwhere(zones[goals, rows[:, None], cols[:, None]]).tolist():
            nearest = self._nearest_bearing(poses[pose], self.goals[goals[pose, column]])
            if nearest is not None:
                side = Action.TURN_LEFT if nearest > 0 else Action.TURN_RIGHT
                ahead = abs(nearest) <= math.radians(self.task.hfov) / 2
                ways.actions[pose, column] = Action.STOP if ahead else side
                ways.bearings[pose, column] = nearest
        return ways

    def _nearest_bearing(self, pose: NDArray[np.float64], goal: Goal) -> float | None:
        """Of what shows of the goal to one who stands in its zone, the bearing nearest to straight ahead."""
        seen = goal_bearings(self.scene, self.grid, self.renderer, self.scene_id, goal, pose, self.task.camera_height)
        return float(seen[np.abs(seen).argmin()]) if seen.size else None

    def points_ahead(self, pose: NDArray[np.float64], goal: int, count: int, spacing: float) -> NDArray[np.float64]:
        """(count, 2) x and z of points on the way to a goal, `spacing` metres apart; it ends in repetitions."""
        points: NDArray[np.float64] = _points_ahead(
            self.fields[goal], self.grid.origin, self.grid.cell, pose[0], pose[2], count, spacing
        )
        return points

    def close(self) -> None:
        """Forget the scene."""
        self.renderer.remove_scene(self.scene_id)


@njit(cache=True)
def _turns(grids, fields, poses, goals, length, turn):  # type: ignore[no-untyped-def]
    """For N poses and goals (N, G), all (N, G): turns to the best heading; what walking as one stands gains, over what
    walking there does; the distance."""
    turns = np.zeros(goals.shape, np.int64)
    gains, distances = np.zeros(turns.shape), np.full(turns.shape, np.inf)
    origin, cell = grids.origin[0], grids.cell[0]
    for i in range(len(poses)):
        pose = poses[i]
        for g in range(goals.shape[1]):
            field = fields[goals[i, g]]
            here = bilinear(field, origin[0], origin[1], cell, pose[0], pose[2])
            distances[i, g] = here
            if not np.isfinite(here):
                continue
            best = turns_towards_goal(grids, 0, field, pose, length, turn, False)
            x, z, _ = walk(grids, 0, pose[0], pose[2], pose[3] + best * turn, length, False)
            most = here - bilinear(field, origin[0], origin[1], cell, x, z)
            x, z, _ = walk(grids, 0, pose[0], pose[2], pose[3], length, False)
            gain = here - bilinear(field, origin[0], origin[1], cell, x, z)
            turns[i, g] = best
            gains[i, g] = gain / most if most > 0 else 1.0
    return turns, gains, distances


@njit(cache=True)
def _points_ahead(field, origin, cell, x, z, count, spacing):  # type: ignore[no-untyped-def]
    points = np.empty((count, 2))
    row, col = int((z - origin[1]) // cell), int((x - origin[0]) // cell)
    walked, number = 0.0, 0
    while number < count:
        below = steepest_descent(field, row, col)
        if below == (row, col):
            break
        walked += cell * math.sqrt((below[0] - row) ** 2 + (below[1] - col) ** 2)
        row, col = below
        if walked >= spacing * (number + 1):
            points[number, 0], points[number, 1] = origin[0] + (col + 0.5) * cell, origin[1] + (row + 0.5) * cell
            number += 1
    for rest in range(number, count):
        points[rest, 0], points[rest, 1] = origin[0] + (col + 0.5) * cell, origin[1] + (row + 0.5) * cell
    return points
