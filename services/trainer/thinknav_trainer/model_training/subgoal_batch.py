"""Lessons as tensors: what the subgoal network is shown, and what it should say. Knows no optimiser."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from thinknav_models.subgoal_language import Vocabulary
from thinknav_models.subgoal_network import MODES
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_trainer.model_training.lessons import Lesson
from thinknav_trainer.model_training.sentences import words_for
from thinknav_trainer.model_training.teacher import NO_WAY

_MIRRORED = {Action.TURN_LEFT: Action.TURN_RIGHT, Action.TURN_RIGHT: Action.TURN_LEFT}


@dataclass(frozen=True)
class Questions:
    """B = N x G questions of one mode, those about the same look side by side.

    views: (N, 1 + K), headings: (N, K), as `SubgoalNetwork.remember` takes them.
    goals: the words of all goals in a row. goal_lengths, modes: (B,). answers: (B, L) tokens, padded.
    """

    views: Tensor
    headings: Tensor
    goals: Tensor
    goal_lengths: Tensor
    modes: Tensor
    answers: Tensor


@dataclass(frozen=True)
class Batch:
    """Pictures (V, S, S, 3) uint8, questions about them, and what else the teacher knows.

    shares: (V, 6, 8, 8) and farness: (V, 8, 8), of the pictures.
    directions: every goal of every look, answered by the direction alone. subgoals: whole sentences, about the goal
    that is looked for. plans: of some looks. The rest is what is right, of `directions` (B,):
    actions: int64, the Action, which is also the index into DIRECTIONS; NO_WAY where there is none.
    bearings, distances: float32. in_view: bool.
    """

    pictures: Tensor
    shares: Tensor
    farness: Tensor
    directions: Questions
    subgoals: Questions
    plans: Questions
    actions: Tensor
    bearings: Tensor
    distances: Tensor
    in_view: Tensor


class Collator:
    """Makes batches for one vocabulary."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary
        self._goal_words = [vocabulary.encode(words_for(category)) for category in GOAL_CATEGORIES]

    def __call__(self, lessons: Sequence[Lesson]) -> Batch:
        """One batch of several lessons."""
        offsets = np.cumsum([0] + [len(lesson.pictures) for lesson in lessons])
        views = [_shifted(lesson.views, offset) for lesson, offset in zip(lessons, offsets, strict=False)]
        headings = [lesson.headings for lesson in lessons]
        goals = np.concatenate([lesson.goals for lesson in lessons])
        actions = np.concatenate([lesson.actions for lesson in lessons])
        directions = self.questions(
            np.concatenate(views),
            np.concatenate(headings),
            goals,
            [self._direction(action) for action in actions.ravel().tolist()],
            "subgoal",
        )
        subgoals = self.questions(
            np.concatenate(views),
            np.concatenate(headings),
            goals[:, :1],
            [self._tokens([text]) for lesson in lessons for text in lesson.sentences],
            "subgoal",
        )
        plan_rows = [row for row, lesson in enumerate(lessons) for _ in lesson.plans]
        plans = [plan for lesson in lessons for plan in lesson.plans]
        planned = self.questions(
            np.stack([views[row][look] for row, (look, _, _) in zip(plan_rows, plans, strict=True)]),
            np.stack([lessons[row].headings[look] for row, (look, _, _) in zip(plan_rows, plans, strict=True)]),
            np.array([[goal] for _, goal, _ in plans]),
            [self._tokens(text) for _, _, text in plans],
            "plan",
        )
        return Batch(
            pictures=torch.from_numpy(np.concatenate([lesson.pictures for lesson in lessons])),
            shares=torch.from_numpy(np.concatenate([lesson.shares for lesson in lessons])).permute(0, 3, 1, 2),
            farness=torch.from_numpy(np.concatenate([lesson.farness for lesson in lessons])),
            directions=directions,
            subgoals=subgoals,
            plans=planned,
            actions=torch.from_numpy(actions.astype(np.int64)).flatten(),
            bearings=torch.from_numpy(np.concatenate([lesson.bearings for lesson in lessons])).flatten(),
            distances=torch.from_numpy(np.concatenate([lesson.distances for lesson in lessons])).flatten(),
            in_view=torch.from_numpy(np.concatenate([lesson.in_view for lesson in lessons])).flatten(),
        )

    def questions(
        self,
        views: NDArray[np.int64],
        headings: NDArray[np.float32],
        goals: NDArray[np.int64],
        answers: list[list[int]],
        mode: str,
    ) -> Questions:
        """views: (N, 1 + K). headings: (N, K). goals: (N, G). answers: the tokens of each of the N x G."""
        words = [self._goal_words[goal] for goal in goals.ravel().tolist()]
        return Questions(
            torch.from_numpy(views),
            torch.from_numpy(headings),
            torch.tensor([word for goal in words for word in goal]),
            torch.tensor([len(goal) for goal in words]),
            torch.full((goals.size,), MODES.index(mode)),
            self._padded(answers),
        )

    def _direction(self, action: int) -> list[int]:
        """The first token of an answer; none without a way."""
        return [] if action == NO_WAY else [self.vocabulary.directions[action]]

    def _tokens(self, sentences: Sequence[str]) -> list[int]:
        """Of the sentences, joined; none of no sentence."""
        tokens: list[int] = []
        for sentence in filter(None, sentences):
            tokens += [self.vocabulary.next] if tokens else []
            tokens += self.vocabulary.encode(sentence)
        return [*tokens, self.vocabulary.end] if tokens else []

    def _padded(self, rows: list[list[int]]) -> Tensor:
        length = max(len(row) for row in rows)
        return torch.tensor([row + [self.vocabulary.padding] * (length - len(row)) for row in rows])


def mirrored(lesson: Lesson) -> Lesson:
    """The lesson of the home's mirror image."""
    actions = lesson.actions.copy()
    for action, other in _MIRRORED.items():
        actions[lesson.actions == action] = other
    return replace(
        lesson,
        pictures=np.ascontiguousarray(lesson.pictures[:, :, ::-1]),
        shares=np.ascontiguousarray(lesson.shares[:, :, ::-1]),
        farness=np.ascontiguousarray(lesson.farness[:, :, ::-1]),
        headings=-lesson.headings,
        actions=actions,
        bearings=-lesson.bearings,
        sights=-lesson.sights,
        sentences=[_mirrored_text(text) for text in lesson.sentences],
        plans=[(look, goal, [_mirrored_text(text) for text in texts]) for look, goal, texts in lesson.plans],
    )


def without_earlier_views(lesson: Lesson, chosen: NDArray[np.bool_]) -> Lesson:
    """The lesson with only the present view in some of the looks: chosen (Q,) bool."""
    views = lesson.views.copy()
    views[chosen, 1:] = -1
    return replace(lesson, views=views)


def _mirrored_text(text: str) -> str:
    if "left" in text:
        return text.replace("left", "right")
    return text.replace("turn right", "turn left")


def _shifted(views: NDArray[np.int64], offset: int) -> NDArray[np.int64]:
    return np.where(views >= 0, views + offset, -1)
