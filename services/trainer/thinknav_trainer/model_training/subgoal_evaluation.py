"""How well the subgoal VLM knows the way, in homes that it has not seen, beside four controls.

Controls: the commonest answer; a blank frame; another home's frame; another goal. An accuracy that a control reaches
too was not won by looking.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray

from thinknav_models.subgoal_network import IMAGE_SIZE, SubgoalNetwork
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_trainer.model_training.frames import HomeSource, SceneSource
from thinknav_trainer.model_training.lessons import Lesson, one_visit_each
from thinknav_trainer.model_training.subgoal_batch import Collator, without_earlier_views
from thinknav_trainer.model_training.subgoal_losses import answer_hidden, remembered

Control = Literal["none", "blank frame", "another frame", "another goal"]
CONTROLS: tuple[Control, ...] = ("none", "blank frame", "another frame", "another goal")

# Looks of a visit (routes, near goals, anywhere): one's exam is anywhere, as the controls and peers have it.
ANYWHERE = (0, 0, 24)
UNDER_WAY = (6, 6, 0)

_BLANK = 128
_BINS = 10
_AHEAD_RAD = math.radians(15)  # the teacher's own limit between a turn and a step


@dataclass(frozen=True)
class Marks:
    """B answered questions. chances: (B, 4) float32, of each of DIRECTIONS. right: (B,) int64. in_view: (B,) bool."""

    chances: NDArray[np.float32]
    right: NDArray[np.int64]
    in_view: NDArray[np.bool_]

    def accuracy(self, chosen: NDArray[np.bool_]) -> float:
        """Share of the chosen questions (B,) in which the likeliest direction is right."""
        return float((self.chances.argmax(axis=1) == self.right)[chosen].mean()) if chosen.any() else float("nan")

    def way_accuracy(self, chosen: NDArray[np.bool_]) -> float:
        """The same among the questions whose answer is not `stop`, of left, right and forward."""
        asked = chosen & (self.right != Action.STOP)
        likeliest = self.chances[:, 1:].argmax(axis=1) + 1
        return float((likeliest == self.right)[asked].mean()) if asked.any() else float("nan")


@dataclass(frozen=True)
class Exam:
    """Marks by what was shown ("one frame", "several frames") and control; the majority's are among them.

    anywhere: at poses anywhere. under_way: on routes and near goals, as an agent asks.
    """

    anywhere: dict[tuple[str, str], Marks]
    under_way: dict[tuple[str, str], Marks]


def exam_lessons(homes: range, looks: tuple[int, int, int], source: SceneSource = HomeSource("val")) -> list[Lesson]:
    """One visit to each of some homes."""
    return list(one_visit_each(homes, IMAGE_SIZE, source, looks))


@torch.inference_mode()
def mark(
    network: SubgoalNetwork, collate: Collator, lessons: Sequence[Lesson], *, several: bool, control: Control = "none"
) -> Marks:
    """Let the network answer. several: show it the earlier views too."""
    network.eval()
    parts = []
    for asked, lesson in zip(_controlled(lessons, control), lessons, strict=True):
        if not several:
            asked = without_earlier_views(asked, np.ones(len(asked.views), np.bool_))
        batch = collate([asked])
        memory = remembered(network, network.trunk(batch.pictures), batch.directions)
        hidden = answer_hidden(network, memory, batch.directions)
        logits = network.logits(hidden[:, 0])[:, list(collate.vocabulary.directions)]
        known = lesson.actions.ravel() >= 0
        chances = logits.softmax(dim=1).numpy()[known]
        parts.append((chances, lesson.actions.ravel()[known].astype(np.int64), lesson.in_view.ravel()[known]))
    chances, right, in_view = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Marks(chances, right, in_view)


def all_marks(network: SubgoalNetwork, collate: Collator, lessons: Sequence[Lesson]) -> dict[tuple[str, str], Marks]:
    """With one frame and with several, with each control, and the majority's.

    One lesson alone has no other's frames: it goes without that control.
    """
    controls = [control for control in CONTROLS if control != "another frame" or len(lessons) > 1]
    marks = {
        (shown, control): mark(network, collate, lessons, several=several, control=control)
        for shown, several in (("one frame", False), ("several frames", True))
        for control in controls
    }
    answered = marks["one frame", "none"]
    sights = np.concatenate([lesson.sights[lesson.actions >= 0] for lesson in lessons])
    return marks | {("either", "majority"): majority(answered), ("either", "bearing known"): beeline(answered, sights)}


def _controlled(lessons: Sequence[Lesson], control: Control) -> Iterator[Lesson]:
    for lesson, other in zip(lessons, [*lessons[1:], lessons[0]], strict=True):
        if control == "blank frame":
            yield replace(lesson, pictures=np.full_like(lesson.pictures, _BLANK))
        elif control == "another frame":
            rows = np.arange(len(lesson.pictures)) % len(other.pictures)
            yield replace(lesson, pictures=other.pictures[rows])
        elif control == "another goal":
            yield replace(lesson, goals=(lesson.goals + 1) % len(GOAL_CATEGORIES))
        else:
            yield lesson


def accuracy_row(marks: Marks) -> dict[str, float]:
    """Accuracy of all four directions and of the way, with the goal in view and not."""
    return {
        "all": marks.accuracy(np.ones(len(marks.right), np.bool_)),
        "all, in view": marks.accuracy(marks.in_view),
        "all, not in view": marks.accuracy(~marks.in_view),
        "way, in view": marks.way_accuracy(marks.in_view),
        "way, not in view": marks.way_accuracy(~marks.in_view),
    }


def joined(marks: Sequence[Marks]) -> Marks:
    """Several exams as one."""
    return Marks(*(np.concatenate([getattr(each, item.name) for each in marks]) for item in fields(Marks)))


def majority(marks: Marks) -> Marks:
    """What always saying the commonest answer would get: the commonest in view, and the commonest not in view."""
    chances = np.zeros_like(marks.chances)
    for chosen in (marks.in_view, ~marks.in_view):
        counts = np.bincount(marks.right[chosen], minlength=chances.shape[1])
        chances[chosen] = counts / max(1, counts.sum())
    return replace(marks, chances=chances)


def beeline(marks: Marks, sights: NDArray[np.float32]) -> Marks:
    """What going straight for a goal in view would get, by its true bearing (B,), NaN where it is not in view.

    It bounds what can be won by finding the goal in the frame alone; more takes knowing how to get around what is
    between. Out of view it is the majority's.
    """
    chances, shown = majority(marks).chances, ~np.isnan(sights)
    side = np.where(sights > 0, Action.TURN_LEFT, Action.TURN_RIGHT)
    chosen = np.where(np.abs(sights) <= _AHEAD_RAD, Action.MOVE_FORWARD, side)
    chances[shown] = np.eye(chances.shape[1], dtype=np.float32)[chosen[shown]]
    return replace(marks, chances=chances)


@dataclass(frozen=True)
class StopMarks:
    """`stop` at a gate. false_rate: false stops over all questions."""

    gate: float
    precision: float
    recall: float
    false_rate: float


def stop_marks(marks: Marks, gate: float) -> StopMarks:
    """How `stop` does when it is said from a probability of `gate` on."""
    said, right = marks.chances[:, Action.STOP] >= gate, marks.right == Action.STOP
    hits = float((said & right).sum())
    return StopMarks(gate, hits / max(1, said.sum()), hits / max(1, right.sum()), float((said & ~right).mean()))


def gate_for_false_stops(marks: Marks, rate: float) -> float:
    """The lowest gate at which false stops are no more than a share of all questions."""
    false = np.sort(marks.chances[marks.right != Action.STOP, Action.STOP])[::-1]
    allowed = int(rate * len(marks.right))
    return float(np.nextafter(false[allowed], np.float32(2))) if allowed < len(false) else 0.0


def calibration(marks: Marks) -> Iterable[tuple[float, float, int]]:
    """Of answers by their confidence, in bins: mean confidence, share that is right, how many."""
    confidence = marks.chances.max(axis=1)
    right = marks.chances.argmax(axis=1) == marks.right
    bins = np.minimum((confidence * _BINS).astype(np.int64), _BINS - 1)
    for number in range(_BINS):
        chosen = bins == number
        if chosen.any():
            yield float(confidence[chosen].mean()), float(right[chosen].mean()), int(chosen.sum())
