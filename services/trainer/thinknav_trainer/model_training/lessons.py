"""Lessons for the subgoal VLM: pictures of a home, what to ask about them, and what the teacher answers.

A stream of lessons is made of visits to homes, each drawn from its number alone, so that a stream can be taken up
again anywhere. Several processes may draw at once (`torch.utils.data.DataLoader`).
"""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch.utils.data import IterableDataset, get_worker_info

from thinknav_models.subgoal_vlm import MAX_SENTENCES
from thinknav_sim.render import Camera, make_renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_trainer.model_training.frames import HomeSource, SceneSource
from thinknav_trainer.model_training.routes import Looks, draw_looks
from thinknav_trainer.model_training.sentences import Passage, subgoal_sentence
from thinknav_trainer.model_training.surroundings import surroundings
from thinknav_trainer.model_training.teacher import NO_WAY, HomeTeacher
from thinknav_trainer.visible import SeenObject, objects_in_view

_SPACING_M, _POINTS = 0.25, 20  # of the way ahead, to find where it leaves the room
_PLANS = 8  # of a visit
GOALS_ASKED = 5  # of each look
VISITS = 2  # to each home


@dataclass(frozen=True)
class Lesson:
    """One visit to a home: V pictures, Q looks at them, and for each look G goals.

    pictures: (V, S, S, 3) uint8. shares: (V, 8, 8, 6) and farness: (V, 8, 8) float32, see `surroundings`.
    views: (Q, 1 + K) and headings (Q, K), as `Looks` has them.
    goals: (Q, G) int64, first the one that is looked for, then others of the home.
    actions: (Q, G) int8, NO_WAY without one. bearings, distances: (Q, G) float32, of the way.
    sights: (Q, G) float32 radians, the bearing of the nearest such thing in view, NaN for none.
    sentences: Q, about the goal that is looked for, "" without a way. plans: (look, goal, sentences) of some.
    """

    pictures: NDArray[np.uint8]
    shares: NDArray[np.float32]
    farness: NDArray[np.float32]
    views: NDArray[np.int64]
    headings: NDArray[np.float32]
    goals: NDArray[np.int64]
    actions: NDArray[np.int8]
    bearings: NDArray[np.float32]
    distances: NDArray[np.float32]
    sights: NDArray[np.float32]
    sentences: list[str]
    plans: list[tuple[int, int, list[str]]]

    @property
    def in_view(self) -> NDArray[np.bool_]:
        """(Q, G): which goals the present view shows."""
        return ~np.isnan(self.sights)


class LessonStream(IterableDataset[Lesson]):
    """Endless visits, from number `start` on, to the first `homes` scenes of a source in turn.

    Two homes at a time are visited `VISITS` times each, turn by turn: to know a home takes as long as a visit.
    """

    def __init__(
        self,
        homes: int,
        size: int,
        start: int = 0,
        source: SceneSource = HomeSource("planner"),
        looks: tuple[int, int, int] = (7, 8, 8),
    ) -> None:
        self.homes, self.size, self.start = homes, size, start
        self.source, self.looks = source, looks

    def __iter__(self) -> Iterator[Lesson]:
        worker = get_worker_info()
        number, step = (self.start, 1) if worker is None else (self.start + worker.id, worker.num_workers)
        task = ObjectNavConfig(width=self.size, height=self.size)
        renderer = make_renderer()
        known: dict[int, HomeTeacher] = {}
        while True:
            home = home_of_visit(number) % self.homes
            if home not in known:
                if len(known) == 2:
                    known.pop(next(iter(known))).close()
                known[home] = HomeTeacher(self.source.scene(home), renderer, task)
            rng = np.random.default_rng([number, 20_11])
            yield give_lesson(known[home], rng, draw_looks(known[home], rng, *self.looks))
            number += step


def one_visit_each(
    homes: Iterable[int], size: int, source: SceneSource, looks: tuple[int, int, int]
) -> Iterator[Lesson]:
    """A visit to each of some scenes of a source."""
    task = ObjectNavConfig(width=size, height=size)
    renderer = make_renderer()
    for home in homes:
        teacher = HomeTeacher(source.scene(home), renderer, task)
        rng = np.random.default_rng([home, 20_11])
        yield give_lesson(teacher, rng, draw_looks(teacher, rng, *looks))
        teacher.close()


def home_of_visit(number: int) -> int:
    """0, 1, 0, 1, 2, 3, 2, 3, ...: which home a visit is to."""
    return number // (2 * VISITS) * 2 + number % 2


def give_lesson(teacher: HomeTeacher, rng: np.random.Generator, looks: Looks) -> Lesson:
    """Take the pictures of some looks and say what the teacher would."""
    task = teacher.task
    camera = Camera(task.width, task.height, task.hfov, task.camera_height)
    pictures, depth = teacher.renderer.render(np.full(len(looks.poses), teacher.scene_id), looks.poses, camera)
    present = looks.poses[looks.views[:, 0]]
    seen = objects_in_view(teacher.scene, present, depth[looks.views[:, 0], :, :, 0], camera)
    goals = _with_others(teacher, rng, looks.goals)
    ways = teacher.ways(present, goals)
    shares, farness = surroundings(teacher.scene, looks.poses, depth[..., 0], camera)
    return Lesson(
        pictures=pictures,
        shares=shares,
        farness=farness,
        views=looks.views,
        headings=looks.headings,
        goals=goals,
        actions=ways.actions,
        bearings=ways.bearings,
        distances=ways.distances,
        sights=np.array(
            [[_sight(GOAL_CATEGORIES[goal], items) for goal in row] for row, items in zip(goals, seen, strict=True)],
            np.float32,
        ),
        sentences=[
            _sentence(teacher, rng, pose, items, int(goal), int(action))
            for pose, items, goal, action in zip(present, seen, looks.goals, ways.actions[:, 0], strict=True)
        ],
        plans=_plans(teacher, rng, present, looks.goals),
    )


def _sight(category: str, seen: tuple[SeenObject, ...]) -> float:
    """The bearing of the nearest of a category, NaN for none."""
    return min(((item.distance, item.bearing) for item in seen if item.category == category), default=(0, math.nan))[1]


def _with_others(teacher: HomeTeacher, rng: np.random.Generator, goals: NDArray[np.int64]) -> NDArray[np.int64]:
    """(Q, GOALS_ASKED): each look's own goal (Q,), then others that can be reached, without repetition if it can be."""
    rows = []
    for goal in goals.tolist():
        others = [other for other in teacher.reachable if other != goal] or [goal]
        extra = rng.choice(others, GOALS_ASKED - 1, replace=len(others) < GOALS_ASKED - 1)
        rows.append([goal, *extra.tolist()])
    return np.array(rows, np.int64)


def _sentence(
    teacher: HomeTeacher,
    rng: np.random.Generator,
    pose: NDArray[np.float64],
    seen: tuple[SeenObject, ...],
    goal: int,
    action: int,
) -> str:
    if action == NO_WAY:
        return ""
    passage = None if action == Action.STOP else _passage(teacher, pose, goal)
    here = _room(teacher.scene, pose[0], pose[2])
    return subgoal_sentence(rng, GOAL_CATEGORIES[goal], Action(action), seen, here, passage)


def _room(scene: Scene, x: float, z: float) -> str:
    """The function of the room at a place; "room" in a scene without any."""
    for room in scene.rooms:
        x0, z0, x1, z1 = room.bounds
        if x0 - 0.1 <= x <= x1 + 0.1 and z0 - 0.1 <= z <= z1 + 0.1:
            return room.function
    return "room"


def _passage(teacher: HomeTeacher, pose: NDArray[np.float64], goal: int) -> Passage | None:
    """Where the way to a goal leaves the room, if it does so soon."""
    if not teacher.scene.rooms:
        return None
    here = _room(teacher.scene, pose[0], pose[2])
    for number, (x, z) in enumerate(teacher.points_ahead(pose, goal, _POINTS, _SPACING_M).tolist()):
        there = _room(teacher.scene, x, z)
        if there != here:
            bearing = math.atan2(-(x - pose[0]), -(z - pose[2])) - pose[3]
            return Passage(_SPACING_M * (number + 1), math.remainder(bearing, 2 * math.pi), here, there)
    return None


def _plans(
    teacher: HomeTeacher, rng: np.random.Generator, present: NDArray[np.float64], goals: NDArray[np.int64]
) -> list[tuple[int, int, list[str]]]:
    """Whole ways from some looks: what to do at each turning, at most MAX_SENTENCES of it."""
    chosen = rng.choice(len(present), min(_PLANS, len(present)), replace=False).tolist()
    return [(look, int(goals[look]), plan_sentences(teacher, rng, present[look], int(goals[look]))) for look in chosen]


def plan_sentences(teacher: HomeTeacher, rng: np.random.Generator, pose: NDArray[np.float64], goal: int) -> list[str]:
    """The way to a goal in a few sentences; the last one stops there, unless the way is too long for it."""
    points = teacher.points_ahead(pose, goal, 60, 2 * _SPACING_M)
    corners = [pose[[0, 2]], *points]
    sentences: list[str] = []
    heading, name = float(pose[3]), GOAL_CATEGORIES[goal]
    for (ax, az), (bx, bz) in itertools.pairwise(corners):
        if math.hypot(bx - ax, bz - az) < 1e-6:
            break
        toward = math.atan2(-(bx - ax), -(bz - az))
        turned = math.remainder(toward - heading, 2 * math.pi)
        action = Action.MOVE_FORWARD
        if abs(turned) > math.radians(35):
            action = Action.TURN_LEFT if turned > 0 else Action.TURN_RIGHT
            heading = toward
        here, there = _room(teacher.scene, ax, az), _room(teacher.scene, bx, bz)
        passage = Passage(0.0, 0.0, here, there) if here != there and action == Action.MOVE_FORWARD else None
        new_leg = not sentences or action != Action.MOVE_FORWARD or passage is not None
        if new_leg or sentences[-1].startswith("turn"):
            sentences.append(subgoal_sentence(rng, name, action, (), here, passage))
    sentences = sentences[: MAX_SENTENCES - 1]
    return [*sentences, subgoal_sentence(rng, name, Action.STOP, (), "room", None)]
