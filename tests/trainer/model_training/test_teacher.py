"""The teacher knows the way: who does what it says arrives; its lessons say what they show."""

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest

from thinknav_models.subgoal_language import Vocabulary
from thinknav_models.subgoal_vlm import MAX_RECENT, MAX_SENTENCES
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.success import faces_goal, goal_bearings
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.model_training.frames import HomeSource
from thinknav_trainer.model_training.lessons import GOALS_ASKED, Lesson, LessonStream, give_lesson, home_of_visit
from thinknav_trainer.model_training.routes import draw_looks, draw_poses, moved
from thinknav_trainer.model_training.sentences import all_words
from thinknav_trainer.model_training.subgoal_batch import mirrored
from thinknav_trainer.model_training.subgoal_training import ROOMS, THINGS
from thinknav_trainer.model_training.teacher import NO_WAY, HomeTeacher
from thinknav_trainer.views import differ

SIZE = 32
TASK = ObjectNavConfig(width=SIZE, height=SIZE)


@pytest.fixture(scope="module")
def teacher() -> Iterator[HomeTeacher]:
    renderer = make_renderer()
    yield HomeTeacher(HomeSource("planner").scene(3), renderer, TASK)
    renderer.close()


@pytest.fixture(scope="module")
def lesson(teacher: HomeTeacher) -> Lesson:
    rng = np.random.default_rng(5)
    return give_lesson(teacher, rng, draw_looks(teacher, rng, 3, 3, 3))


def test_who_does_what_the_teacher_says_finds_the_goal(teacher: HomeTeacher) -> None:
    rng = np.random.default_rng(0)
    for pose in draw_poses(teacher, rng, 12):
        goal = int(rng.choice(teacher.reachable))
        for _ in range(200):
            action = Action(int(teacher.ways(pose[None], np.array([[goal]])).actions[0, 0]))
            if action == Action.STOP:
                break
            pose = moved(teacher, pose, action)
        else:
            pytest.fail(f"no {GOAL_CATEGORIES[goal]} within 200 steps")
        found = teacher.goals[goal]
        seen = goal_bearings(
            teacher.scene, teacher.grid, teacher.renderer, teacher.scene_id, found, pose, TASK.camera_height
        )
        assert faces_goal(seen, TASK.hfov)


def test_a_goal_that_is_not_there_has_no_way(teacher: HomeTeacher) -> None:
    missing = [index for index, goal in enumerate(teacher.goals) if not goal.objects]
    poses = draw_poses(teacher, np.random.default_rng(1), 2)
    for goal in missing:
        ways = teacher.ways(poses, np.full((2, 1), goal))
        assert (ways.actions == NO_WAY).all()
        assert np.isinf(ways.distances).all()
    assert teacher.reachable


def test_points_ahead_lead_to_the_goal(teacher: HomeTeacher) -> None:
    pose = draw_poses(teacher, np.random.default_rng(2), 1)[0]
    goal = teacher.reachable[0]
    points = teacher.points_ahead(pose, goal, 100, 0.5)
    places = np.stack([points[:, 0], np.zeros(100), points[:, 1], np.zeros(100)], axis=1)
    distances = teacher.ways(places, np.full((100, 1), goal)).distances[:, 0]
    assert (np.diff(distances) <= 1e-6).all()
    assert distances[-1] < 0.1


def test_sentences_say_the_way_in_words_that_are_known(lesson: Lesson) -> None:
    vocabulary = Vocabulary(all_words(THINGS, ROOMS))
    for action, goal, sentence in zip(lesson.actions[:, 0], lesson.goals[:, 0], lesson.sentences, strict=True):
        assert subgoal_direction(sentence) == action
        assert vocabulary.unknown not in vocabulary.encode(sentence), sentence
        if action == Action.STOP:
            assert GOAL_CATEGORIES[goal].replace("_", " ") in sentence


def test_plans_end_by_stopping(lesson: Lesson) -> None:
    assert lesson.plans
    for look, goal, sentences in lesson.plans:
        assert goal == lesson.goals[look, 0]
        assert 1 <= len(sentences) <= MAX_SENTENCES
        assert [subgoal_direction(sentence) == Action.STOP for sentence in sentences] == [False] * (
            len(sentences) - 1
        ) + [True]


def test_looks_refer_to_views_that_differ(teacher: HomeTeacher) -> None:
    looks = draw_looks(teacher, np.random.default_rng(7), 4, 3, 3)
    assert looks.views.shape == (len(looks.goals), 1 + MAX_RECENT)
    assert (looks.views[:, 0] >= 0).all()
    assert looks.views.max() < len(looks.poses)
    assert (looks.views[:, 1:] >= 0).any()
    for views, headings in zip(looks.views, looks.headings, strict=True):
        for view, heading in zip(views[1:], headings, strict=True):
            if view >= 0:
                present, earlier = looks.poses[views[0]], looks.poses[view]
                assert differ(present, earlier)
                assert math.remainder(earlier[3] - present[3] - heading, 2 * math.pi) == pytest.approx(0, abs=1e-5)


def test_each_look_asks_for_several_goals_of_the_home(teacher: HomeTeacher, lesson: Lesson) -> None:
    assert lesson.goals.shape[1] == GOALS_ASKED
    assert set(lesson.goals.ravel().tolist()) <= set(teacher.reachable)
    assert all(len(set(goals)) == GOALS_ASKED for goals in lesson.goals.tolist())


def test_a_mirrored_lesson_is_that_of_the_mirrored_home(lesson: Lesson) -> None:
    other = mirrored(lesson)
    assert (other.pictures == lesson.pictures[:, :, ::-1]).all()
    assert (other.shares == lesson.shares[:, :, ::-1]).all()
    swapped = {Action.TURN_LEFT: Action.TURN_RIGHT, Action.TURN_RIGHT: Action.TURN_LEFT}
    for row, actions in enumerate(lesson.actions):
        assert other.actions[row].tolist() == [swapped.get(action, action) for action in actions]
        assert subgoal_direction(other.sentences[row]) == other.actions[row, 0]
    back = mirrored(other)
    assert back.sentences == lesson.sentences
    assert back.plans == lesson.plans
    assert (back.headings == lesson.headings).all()
    assert (back.bearings == lesson.bearings).all()
    assert np.array_equal(back.sights, lesson.sights, equal_nan=True)
    assert np.array_equal(other.sights, -lesson.sights, equal_nan=True)


def test_goals_in_view_are_in_the_cells_too(lesson: Lesson) -> None:
    present = lesson.shares[lesson.views[:, 0]].max(axis=(1, 2))
    shown = np.take_along_axis(present, lesson.goals, axis=1) > 0
    assert lesson.in_view.any()
    assert (np.abs(lesson.sights[lesson.in_view]) < math.radians(40)).all()  # half the field of view
    assert (shown == lesson.in_view).mean() > 0.8  # cells are read off fewer rays, and smaller boxes hide nothing


def test_a_stream_is_taken_up_anywhere() -> None:
    whole = list(itertools.islice(LessonStream(8, SIZE, looks=(1, 1, 1)), 6))
    for start in (1, 3, 4):
        again = next(iter(LessonStream(8, SIZE, start=start, looks=(1, 1, 1))))
        assert (again.pictures == whole[start].pictures).all()
        assert again.sentences == whole[start].sentences


def test_two_homes_take_turns_and_each_visit_is_another() -> None:
    assert [home_of_visit(number) for number in range(10)] == [0, 1, 0, 1, 2, 3, 2, 3, 4, 5]
    first, _, again = itertools.islice(LessonStream(8, SIZE, looks=(1, 1, 1)), 3)
    assert not np.array_equal(first.pictures[0], again.pictures[0])
