"""Teaching the subgoal model: it learns, is taken up again, and its marks mean what they say."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from thinknav_sim.task_config import Action
from thinknav_trainer.model_training.frames import ScanSource
from thinknav_trainer.model_training.lessons import Lesson, LessonStream
from thinknav_trainer.model_training.subgoal_batch import Collator, without_earlier_views
from thinknav_trainer.model_training.subgoal_evaluation import (
    Marks,
    accuracy_row,
    all_marks,
    beeline,
    calibration,
    gate_for_false_stops,
    joined,
    majority,
    mark,
    stop_marks,
)
from thinknav_trainer.model_training.subgoal_losses import batch_losses
from thinknav_trainer.model_training.subgoal_training import Lessons, Pupil, Schooling, SchoolingError, teach

SHORT = Schooling(visits=4, batch=1, save_every=2, warm_up=2)


@pytest.fixture(scope="module")
def lessons() -> list[Lesson]:
    stream = iter(LessonStream(2, 128, looks=(1, 1, 1)))
    return [next(stream), next(stream)]


def in_turn(lessons: list[Lesson]):  # type: ignore[no-untyped-def]
    def draw(schooling: Schooling, update: int) -> Lessons:
        while True:
            yield [lessons[update % 2]]
            update += 1

    return draw


def test_it_learns_what_it_is_shown(lessons: list[Lesson]) -> None:
    pupil = Pupil(dataclasses.replace(SHORT, visits=30))
    losses = [pupil.learn([lessons[0]]) for _ in range(30)]
    for name in ("direction", "words", "plan", "goals", "farness"):
        assert losses[-1][name] < 0.8 * losses[0][name], name


def test_taken_up_again_it_ends_the_same(lessons: list[Lesson], tmp_path: Path) -> None:
    whole = teach(SHORT, tmp_path / "whole", in_turn(lessons))

    def interrupted(schooling: Schooling, update: int) -> Iterator[list[Lesson]]:
        yield [lessons[0]]
        yield [lessons[1]]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        teach(SHORT, tmp_path / "parts", interrupted)
    parts = teach(SHORT, tmp_path / "parts", in_turn(lessons))
    one, other = (torch.cat([each.flatten() for each in pupil.network.parameters()]) for pupil in (whole, parts))
    # The last bits of a matrix product may depend on where its memory lies; a lost momentum changes all by far more.
    assert (one - other).abs().mean() < 1e-5


def test_another_schooling_is_refused(lessons: list[Lesson], tmp_path: Path) -> None:
    teach(dataclasses.replace(SHORT, visits=2), tmp_path, in_turn(lessons))
    with pytest.raises(SchoolingError, match="teach in another folder"):
        teach(SHORT, tmp_path, in_turn(lessons))


def test_lessons_of_another_source_are_refused(lessons: list[Lesson], tmp_path: Path) -> None:
    """Else weights of one scan would be handed out as those of another."""
    teach(SHORT, tmp_path, in_turn(lessons), ScanSource((Path("a.glb"),)))
    with pytest.raises(SchoolingError, match=r"was taught with ScanSource.*a\.glb.*, not ScanSource.*b\.glb"):
        teach(SHORT, tmp_path, in_turn(lessons), ScanSource((Path("b.glb"),)))


def test_a_lesson_alone_has_no_other_frames_to_control_with(lessons: list[Lesson]) -> None:
    pupil = Pupil(SHORT)
    collate = Collator(pupil.vocabulary)
    alone, together = (all_marks(pupil.network, collate, group) for group in (lessons[:1], lessons))
    assert set(together) - set(alone) == {("one frame", "another frame"), ("several frames", "another frame")}


def test_what_is_padded_or_has_no_way_costs_nothing(lessons: list[Lesson]) -> None:
    pupil = Pupil(SHORT)
    pupil.network.eval()
    collate = Collator(pupil.vocabulary)
    lesson = lessons[0]
    blind = dataclasses.replace(lesson, actions=lesson.actions.copy(), sentences=["", *lesson.sentences[1:]])
    blind.actions[0, 0] = -1
    for other in (lesson, blind):
        losses = batch_losses(pupil.network, collate([other]), pupil.vocabulary)
        assert all(torch.isfinite(loss) for loss in losses.values())
    rest = batch_losses(pupil.network, collate([blind]), pupil.vocabulary)["direction"]
    blind.bearings[0, 0] += 1.0  # of a way that is not there
    same = batch_losses(pupil.network, collate([blind]), pupil.vocabulary)
    assert torch.equal(same["direction"], rest)


def test_two_lessons_make_the_batch_of_each(lessons: list[Lesson]) -> None:
    pupil = Pupil(SHORT)
    pupil.network.eval()
    one, other, both = (mark(pupil.network, Collator(pupil.vocabulary), group, several=True) for group in (
        lessons[:1], lessons[1:], lessons
    ))  # fmt: skip
    np.testing.assert_allclose(np.concatenate([one.chances, other.chances]), both.chances, atol=1e-6)
    batch = Collator(pupil.vocabulary)(lessons)
    count = len(lessons[0].pictures)
    assert batch.subgoals.views[len(lessons[0].views), 0] == lessons[1].views[0, 0] + count


def test_without_earlier_views_only_the_present_is_left(lessons: list[Lesson]) -> None:
    chosen = np.zeros(len(lessons[0].views), np.bool_)
    chosen[1] = True
    lesson = without_earlier_views(lessons[0], chosen)
    assert (lesson.views[1, 1:] == -1).all()
    assert (lesson.views[:, 0] == lessons[0].views[:, 0]).all()
    assert (lesson.views[~chosen] == lessons[0].views[~chosen]).all()


@pytest.fixture
def marks() -> Marks:
    stop, forward, left, right = np.eye(4, dtype=np.float32) * 0.6 + 0.1
    return Marks(
        chances=np.stack([stop, stop, forward, left, left, right]),
        right=np.array([0, 2, 1, 2, 0, 2]),  # by Action
        in_view=np.array([True, True, True, False, False, False]),
    )  # fmt: skip


def test_marks_are_counted_right(marks: Marks) -> None:
    row = accuracy_row(marks)
    assert row["all"] == pytest.approx(3 / 6)
    assert row["all, in view"] == pytest.approx(2 / 3)
    assert row["way, in view"] == pytest.approx(1 / 2)  # without `stop`, whatever is left is likeliest
    assert row["way, not in view"] == pytest.approx(1 / 2)


def test_the_beeline_goes_where_the_goal_is_seen(marks: Marks) -> None:
    sights = np.array([0.1, 0.5, -0.2, np.nan, np.nan, np.nan], np.float32)
    chosen = beeline(marks, sights).chances.argmax(axis=1)
    assert chosen.tolist()[:3] == [1, 2, 1]
    assert (beeline(marks, sights).chances[3:] == majority(marks).chances[3:]).all()


def test_stops_are_counted_right(marks: Marks) -> None:
    at_gate = stop_marks(marks, 0.5)
    assert (at_gate.precision, at_gate.recall, at_gate.false_rate) == pytest.approx((1 / 2, 1 / 2, 1 / 6))


@pytest.mark.parametrize(("rate", "false"), [(0.0, 0), (1 / 6, 1), (1.0, 4)])
def test_the_gate_keeps_false_stops_to_a_share(marks: Marks, rate: float, false: int) -> None:
    gate = gate_for_false_stops(marks, rate)
    assert stop_marks(marks, gate).false_rate * len(marks.right) == pytest.approx(false)


def test_exams_are_joined(marks: Marks) -> None:
    both = joined([marks, marks])
    assert len(both.right) == 2 * len(marks.right)
    assert accuracy_row(both) == accuracy_row(marks)


def test_the_majority_is_that_of_each_cell(marks: Marks) -> None:
    likeliest = majority(marks).chances.argmax(axis=1)
    assert likeliest[3:].tolist() == [Action.TURN_LEFT] * 3


def test_calibration_counts_all(marks: Marks) -> None:
    ((confidence, right, count),) = calibration(marks)
    assert (confidence, right) == pytest.approx((0.7, 0.5))
    assert count == 6
