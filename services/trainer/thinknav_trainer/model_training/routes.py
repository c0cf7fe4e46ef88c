"""Where a home is looked at from to teach the subgoal VLM: on noisy routes, near goals, and anywhere.

A look is a pose that questions are asked in, with the poses of its earlier views. Earlier views come as an agent would
have them (`views.RecentViews`), or from looking around on the spot. Knows the teacher; draws nothing.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_models.subgoal_vlm import MAX_RECENT
from thinknav_sim.navigation.kinematics import walk
from thinknav_sim.task_config import Action
from thinknav_trainer.model_training.teacher import HomeTeacher
from thinknav_trainer.views import RecentViews

_ROUTE_STEPS = 40
_LOOKS_OF_A_ROUTE = 10
_SIDE_RAD = math.radians(70)  # the side views of a look around
_NEAR_M = 2.0


@dataclass(frozen=True)
class Looks:
    """Q looks over V views.

    poses: (V, 4). goals: (Q,) int64, what one looks for, an index into GOAL_CATEGORIES.
    views: (Q, 1 + MAX_RECENT) int64 into the poses, the present view first, -1 for none.
    headings: (Q, MAX_RECENT) float32, of earlier views relative to the present one.
    """

    poses: NDArray[np.float64]
    goals: NDArray[np.int64]
    views: NDArray[np.int64]
    headings: NDArray[np.float32]


class LookList:
    """Gathers looks; a pose that is used twice is one view."""

    def __init__(self) -> None:
        self._poses: list[NDArray[np.float64]] = []
        self._goals: list[int] = []
        self._views: list[list[int]] = []
        self._headings: list[list[float]] = []

    def add_pose(self, pose: NDArray[np.float64]) -> int:
        """The view of a pose."""
        self._poses.append(np.array(pose))
        return len(self._poses) - 1

    def add_look(self, goal: int, present: int, earlier: list[tuple[int, float]]) -> None:
        """A look for a goal, with its earlier views and their relative headings."""
        self._goals.append(goal)
        missing = MAX_RECENT - len(earlier)
        self._views.append([present, *(view for view, _ in earlier), *[-1] * missing])
        self._headings.append([*(heading for _, heading in earlier), *[0.0] * missing])

    def looks(self) -> Looks:
        """All of them."""
        return Looks(
            np.stack(self._poses),
            np.array(self._goals, np.int64),
            np.array(self._views, np.int64),
            np.array(self._headings, np.float32),
        )


def draw_looks(teacher: HomeTeacher, rng: np.random.Generator, routes: int, near: int, anywhere: int) -> Looks:
    """So many routes, spots near goals and spots anywhere, each giving several looks."""
    looks = LookList()
    for _ in range(routes):
        _follow_route(teacher, rng, looks)
    for _ in range(near):
        goal = int(rng.choice(teacher.reachable))
        _turn_on_the_spot(rng, _near(teacher, rng, goal), goal, looks)
    for start in draw_poses(teacher, rng, anywhere):
        look_around(rng, start, int(rng.choice(teacher.reachable)), looks)
    return looks.looks()


def draw_poses(teacher: HomeTeacher, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Poses (count, 4) anywhere in a home."""
    positions = teacher.grid.random_navigable(rng, count)
    return np.concatenate([positions, rng.uniform(-math.pi, math.pi, (count, 1))], axis=1)


def _near(teacher: HomeTeacher, rng: np.random.Generator, goal: int) -> NDArray[np.float64]:
    """A pose within two metres' walk of a goal, more often than not turned to its way."""
    near = teacher.grid.navigable & (teacher.fields[goal] < rng.uniform(0.1, _NEAR_M))
    position = teacher.grid.random_positions(rng, near, 1)[0]
    pose = np.array([*position, rng.uniform(-math.pi, math.pi)])
    if rng.random() < 0.7:
        pose[3] += float(teacher.ways(pose[None], np.array([[goal]])).bearings[0, 0]) + rng.normal(0, 0.5)
    return pose


def look_around(rng: np.random.Generator, pose: NDArray[np.float64], goal: int, looks: LookList) -> None:
    """A look ahead with views to both sides, and one to a side with that ahead."""
    ahead, on_left, on_right = (looks.add_pose(_turned(pose, angle)) for angle in (0.0, _SIDE_RAD, -_SIDE_RAD))
    looks.add_look(goal, ahead, [(on_left, _SIDE_RAD), (on_right, -_SIDE_RAD)])
    if rng.random() < 0.5:
        looks.add_look(goal, on_left, [(ahead, -_SIDE_RAD)])
    else:
        looks.add_look(goal, on_right, [(ahead, _SIDE_RAD)])


def _turned(pose: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    turned: NDArray[np.float64] = pose + np.array([0.0, 0.0, 0.0, angle])
    return turned


def _turn_on_the_spot(rng: np.random.Generator, pose: NDArray[np.float64], goal: int, looks: LookList) -> None:
    recent: RecentViews[int] = RecentViews(MAX_RECENT)
    step = math.radians(10) * rng.choice([-5, -4, -3, -2, 2, 3, 4, 5])
    for _ in range(3):
        view = looks.add_pose(pose)
        looks.add_look(goal, view, recent.before(pose))
        recent.see(pose, view)
        pose = _turned(pose, step)


def _follow_route(teacher: HomeTeacher, rng: np.random.Generator, looks: LookList) -> None:
    """An agent under way to a goal, with now and then an act of its own; looked at in some of its steps."""
    goal = int(rng.choice(teacher.reachable))
    noise = float(rng.choice([0.0, 0.15, 0.35, 0.6]))
    pose = draw_poses(teacher, rng, 1)[0]
    recent: RecentViews[int] = RecentViews(MAX_RECENT)
    asked = set(rng.choice(_ROUTE_STEPS, _LOOKS_OF_A_ROUTE, replace=False).tolist())
    whim, whims = Action.MOVE_FORWARD, 0
    for step in range(_ROUTE_STEPS):
        if step in asked or recent.is_new(pose):
            view = looks.add_pose(pose)
            if step in asked:
                looks.add_look(goal, view, recent.before(pose))
            recent.see(pose, view)
        action = Action(int(teacher.ways(pose[None], np.array([[goal]])).actions[0, 0]))
        if whims == 0 and rng.random() < noise / 3:
            whim, whims = Action(int(rng.integers(Action.MOVE_FORWARD, Action.THINK))), int(rng.integers(1, 6))
        if whims:
            action, whims = whim, whims - 1
        if action == Action.STOP:
            goal = int(rng.choice(teacher.reachable))
            continue
        pose = moved(teacher, pose, action)


def moved(teacher: HomeTeacher, pose: NDArray[np.float64], action: Action) -> NDArray[np.float64]:
    """Where a pose (4,) is after a turn or a step forward, without sliding."""
    x, y, z, heading = pose
    if action != Action.MOVE_FORWARD:
        turn = math.radians(teacher.task.turn_angle)
        return _turned(pose, turn if action == Action.TURN_LEFT else -turn)
    x, z, _ = walk(teacher.table, 0, x, z, heading, teacher.task.forward_step, False)
    return np.array([x, y, z, heading])
