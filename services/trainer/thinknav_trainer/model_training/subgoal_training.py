"""Teaches the subgoal VLM: draw lessons, answer, correct, save, until the visits are used up.

Knows nothing of how well it does in homes that it has not seen; `subgoal_evaluation` does.
"""

import logging
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torch.utils.data import DataLoader

from thinknav_models.subgoal_language import Vocabulary
from thinknav_models.subgoal_network import NetworkConfig, SubgoalNetwork, bearing_loss_targets
from thinknav_trainer.model_training.lessons import Lesson, LessonStream
from thinknav_trainer.model_training.sentences import all_words
from thinknav_trainer.model_training.subgoal_batch import Batch, Collator, Questions, mirrored, without_earlier_views
from thinknav_trainer.precision import autocast
from thinknav_trainer.progress import progress_bar

logger = logging.getLogger(__name__)

# What else stands in homes and how rooms are called: words the model may use.
THINGS = (
    "bathtub", "cabinet", "counter", "desk", "dresser", "fridge", "nightstand", "shelf", "shower", "sink", "stove",
    "table", "wardrobe",
)  # fmt: skip
ROOMS = ("bathroom", "bedroom", "dining room", "hallway", "kitchen", "living room", "studio", "study")

_SIZE = 128
_REST_WEIGHT = 0.3  # of words after the direction: there are many right ones
_WAY_WEIGHT = 0.5
_GOALS_WEIGHT = 5.0
_FARNESS_WEIGHT = 2.0
_PLAN_WEIGHT = 0.2
_ALONE = 0.5  # of the looks are at the present view alone


@dataclass(frozen=True)
class Schooling:
    """How long and how fast. visits: lessons in all. homes: distinct ones. batch: visits of an update."""

    visits: int = 6000
    homes: int = 100_000
    batch: int = 2
    lr: float = 2e-3
    warm_up: int = 100
    weight_decay: float = 0.02
    save_every: int = 200
    seed: int = 0


def new_network() -> tuple[Vocabulary, SubgoalNetwork]:
    """An untaught network and the words that it will know."""
    vocabulary = Vocabulary(all_words(THINGS, ROOMS))
    return vocabulary, SubgoalNetwork(NetworkConfig(vocabulary=len(vocabulary)))


def teach(schooling: Schooling, folder: Path) -> tuple[Vocabulary, SubgoalNetwork]:
    """Teach a network, or go on with the one in the folder; leaves `checkpoint.pt` there."""
    torch.manual_seed(schooling.seed)
    vocabulary, network = new_network()
    optimizer = torch.optim.AdamW(network.parameters(), lr=schooling.lr, weight_decay=schooling.weight_decay)
    ema = get_ema_multi_avg_fn(0.998)
    averaged = AveragedModel(network, multi_avg_fn=ema, use_buffers=True)
    done = _resume(folder, schooling, network, averaged, optimizer)
    collate = Collator(vocabulary)
    network.train()
    updates = schooling.visits // schooling.batch
    means: dict[str, float] = {}
    with progress_bar("teaching the subgoal model", updates, done, unit="updates") as bar:
        for update, lessons in zip(range(done, updates), _lessons(schooling, done), strict=False):
            rng = np.random.default_rng([schooling.seed, update])
            batch = collate([_varied(lesson, rng) for lesson in lessons])
            for group in optimizer.param_groups:
                group["lr"] = schooling.lr * _rate(update, updates, schooling.warm_up)
            losses = batch_losses(network, batch, vocabulary)
            optimizer.zero_grad(set_to_none=True)
            sum(losses.values()).backward()  # type: ignore[union-attr]
            torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimizer.step()
            averaged.update_parameters(network)
            for name, loss in losses.items():
                means[name] = 0.98 * means.get(name, float(loss.detach())) + 0.02 * float(loss.detach())
            bar.update(update + 1, " ".join(f"{name} {value:.3f}" for name, value in means.items()))
            if (update + 1) % schooling.save_every == 0 or update + 1 == updates:
                _save(folder, schooling, network, averaged, optimizer, update + 1)
    return vocabulary, averaged.module


def batch_losses(network: SubgoalNetwork, batch: Batch, vocabulary: Vocabulary) -> dict[str, Tensor]:
    """What to correct, by name, already weighed."""
    with autocast("auto"):
        features = network.trunk(batch.pictures)
        hidden = answer_hidden(network, features, batch.subgoals)
        logits = network.logits(hidden)
        auxiliary = network.way(hidden[:, 0]).float()
        where = network.surroundings(features).float()
        plan_logits = network.logits(answer_hidden(network, features, batch.plans))
    known = batch.directions >= 0
    answers = batch.subgoals.answers
    direction = functional.cross_entropy(logits[known, 0], answers[known, 0])
    rest = functional.cross_entropy(logits[:, 1:].flatten(0, 1), answers[:, 1:].flatten(), ignore_index=vocabulary.padding)
    plan = functional.cross_entropy(plan_logits.flatten(0, 1), batch.plans.answers.flatten(), ignore_index=vocabulary.padding)
    wanted = bearing_loss_targets(batch.bearings[known], batch.distances[known], batch.in_view[known])
    aside = functional.smooth_l1_loss(auxiliary[known], wanted)
    return {
        "direction": direction,
        "words": _REST_WEIGHT * rest,
        "plan": _PLAN_WEIGHT * plan,
        "way": _WAY_WEIGHT * aside,
        "goals": _GOALS_WEIGHT * functional.binary_cross_entropy_with_logits(where[:, 1:], batch.shares),
        "farness": _FARNESS_WEIGHT * functional.smooth_l1_loss(where[:, 0], batch.farness),
    }


def answer_hidden(network: SubgoalNetwork, features: Tensor, questions: Questions) -> Tensor:
    """The decoder's states (B, L, width) from which each token of the answers (B, L) is to be guessed."""
    memory = network.remember(features, questions.views, questions.headings)
    first = network.first_token(questions.goals, questions.goal_lengths, questions.modes)
    hidden, _ = network.decode(first, questions.answers[:, :-1], memory)
    return hidden


def _rate(update: int, updates: int, warm_up: int) -> float:
    """Of the full learning rate: up in a line, down in half a cosine."""
    return min((update + 1) / warm_up, 0.5 + 0.5 * math.cos(math.pi * update / updates) + 0.01)


def _varied(lesson: Lesson, rng: np.random.Generator) -> Lesson:
    """The lesson or its mirror image, some looks without their earlier views."""
    lesson = without_earlier_views(lesson, rng.random(len(lesson.views)) < _ALONE)
    return mirrored(lesson) if rng.random() < 0.5 else lesson


def _first_of_one(lessons: list[Lesson]) -> Lesson:
    return lessons[0]


def _lessons(schooling: Schooling, done: int) -> Iterator[list[Lesson]]:
    """The lessons of each update, drawn in a process beside this one."""
    stream = LessonStream(schooling.homes, _SIZE, start=done * schooling.batch)
    loader = DataLoader(
        stream, batch_size=1, collate_fn=_first_of_one, num_workers=1, prefetch_factor=8, multiprocessing_context="spawn"
    )
    visits = iter(loader)
    while True:
        yield [next(visits) for _ in range(schooling.batch)]


def _save(folder: Path, schooling: Schooling, network: Any, averaged: Any, optimizer: Any, done: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    state = {
        "schooling": asdict(schooling),
        "network": network.state_dict(),
        "averaged": averaged.state_dict(),
        "optimizer": optimizer.state_dict(),
        "updates": done,
    }
    aside = folder / "checkpoint.tmp"
    torch.save(state, aside)
    aside.replace(folder / "checkpoint.pt")


def _resume(folder: Path, schooling: Schooling, network: Any, averaged: Any, optimizer: Any) -> int:
    path = folder / "checkpoint.pt"
    if not path.exists():
        return 0
    state = torch.load(path, weights_only=True)
    network.load_state_dict(state["network"])
    averaged.load_state_dict(state["averaged"])
    optimizer.load_state_dict(state["optimizer"])
    logger.info("going on after %d updates of %s", state["updates"], path)
    return int(state["updates"])
