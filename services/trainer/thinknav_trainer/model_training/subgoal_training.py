"""Teaches the subgoal VLM: draw lessons, answer, correct, save, until the visits are used up.

Knows nothing of how well it does in homes that it has not seen; `subgoal_evaluation` does.
"""

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader

from thinknav_models.subgoal_language import Vocabulary
from thinknav_models.subgoal_network import IMAGE_SIZE, NetworkConfig, SubgoalNetwork
from thinknav_trainer.checkpoint import load_tensors
from thinknav_trainer.errors import UserError
from thinknav_trainer.files import replacing
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.drawn_ahead import drawn_ahead
from thinknav_trainer.model_training.frames import HomeSource, SceneSource
from thinknav_trainer.model_training.lessons import Lesson, LessonStream
from thinknav_trainer.model_training.sentences import all_words
from thinknav_trainer.model_training.subgoal_batch import Collator, mirrored, without_earlier_views
from thinknav_trainer.model_training.subgoal_losses import batch_losses
from thinknav_trainer.progress import progress_bar

logger = logging.getLogger(__name__)

# What else stands in homes and how rooms are called: words the model may use.
THINGS = (
    "bathtub", "cabinet", "counter", "desk", "dresser", "fridge", "nightstand", "shelf", "shower", "sink", "stove",
    "table", "wardrobe",
)  # fmt: skip
ROOMS = ("bathroom", "bedroom", "dining room", "hallway", "kitchen", "living room", "studio", "study")

_ALONE = 0.5  # of the looks are at the present view alone
_NOTED = 50  # updates that a loss in the progress bar is the mean of, roughly

Lessons = Iterator[list[Lesson]]


class SchoolingError(UserError):
    """Teaching that cannot go on; the message says why, and what to do."""


@dataclass(frozen=True)
class Schooling:
    """How long and how fast. visits: lessons in all. homes: distinct ones. batch: visits of an update."""

    visits: int = 6000
    homes: int = 100_000
    batch: int = 2
    lr: float = 2e-3
    warm_up: int = 100
    weight_decay: float = 0.02
    save_every: int = 100
    seed: int = 0

    @property
    def updates(self) -> int:
        return self.visits // self.batch


class Pupil:
    """A network being taught: what is saved and taken up again."""

    def __init__(self, schooling: Schooling, source: SceneSource = HomeSource("planner")) -> None:
        """source: of the lessons, so that it is not taken up in another one."""
        torch.manual_seed(schooling.seed)
        self.schooling = schooling
        self.source = repr(source)
        self.vocabulary = Vocabulary(all_words(THINGS, ROOMS))
        self.network = SubgoalNetwork(NetworkConfig(vocabulary=len(self.vocabulary)))
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=schooling.lr, weight_decay=schooling.weight_decay
        )
        self.updates = 0
        self._collate = Collator(self.vocabulary)

    def learn(self, lessons: list[Lesson]) -> dict[str, float]:
        """One update; the losses before it."""
        rng = np.random.default_rng([self.schooling.seed, self.updates])
        batch = self._collate([_varied(lesson, rng) for lesson in lessons])
        for group in self.optimizer.param_groups:
            group["lr"] = self.schooling.lr * _rate(self.updates, self.schooling)
        self.network.train()
        losses = batch_losses(self.network, batch, self.vocabulary)
        self.optimizer.zero_grad(set_to_none=True)
        torch.stack(list(losses.values())).sum().backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        self.updates += 1
        return {name: float(loss.detach()) for name, loss in losses.items()}

    def save(self, path: Path) -> None:
        """Write all that goes on depends on, whole or not at all."""
        state = {
            "schooling": asdict(self.schooling),
            "source": self.source,
            "network": self.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "updates": self.updates,
        }
        with replacing(path) as file:
            torch.save(state, file)

    def restore(self, path: Path) -> None:
        """Go on where `save` was called. Raises SchoolingError for a file of another schooling, or in other scenes."""
        state = load_tensors(path)
        taught = {"schooling": state.get("schooling"), "source": state.get("source", self.source)}
        for name, wanted in (("schooling", asdict(self.schooling)), ("source", self.source)):
            if taught[name] != wanted:
                raise SchoolingError(
                    f"{path} was taught with {taught[name]}, not {wanted}; "
                    "go on with the same, or teach in another folder"
                )
        self.network.load_state_dict(state["network"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.updates = int(state["updates"])
        logger.info("going on after %d updates of %s", self.updates, path)


def teach(
    schooling: Schooling,
    folder: Path,
    lessons: Callable[[Schooling, int], Lessons] | None = None,
    source: SceneSource = HomeSource("planner"),
    interruption: Interruption | None = None,
) -> Pupil:
    """Teach a network, or go on with the one in the folder; leaves `checkpoint.pt` there.

    lessons: those from an update on; unless given, drawn in the scenes of `source`. An interruption ends it early, with
    a checkpoint. Raises SchoolingError.
    """
    pupil = Pupil(schooling, source)
    checkpoint = folder / "checkpoint.pt"
    if checkpoint.exists():
        pupil.restore(checkpoint)
    drawn = lessons(schooling, pupil.updates) if lessons else draw_lessons(schooling, pupil.updates, source)
    noted: dict[str, float] = {}
    with progress_bar("teaching the subgoal model", schooling.updates, pupil.updates, unit="updates") as bar:
        while pupil.updates < schooling.updates and not (interruption and interruption.requested):
            losses = pupil.learn(next(drawn))
            for name, loss in losses.items():
                noted[name] = noted.get(name, loss) + (loss - noted.get(name, loss)) / _NOTED
            bar.update(pupil.updates, " ".join(f"{name} {value:.3f}" for name, value in noted.items()))
            if pupil.updates % schooling.save_every == 0:
                pupil.save(checkpoint)
    pupil.save(checkpoint)
    return pupil


def draw_lessons(schooling: Schooling, update: int, source: SceneSource = HomeSource("planner")) -> Lessons:
    """The lessons of each update from one on, drawn in a process beside this one."""
    stream = LessonStream(schooling.homes, IMAGE_SIZE, update * schooling.batch, source)
    loader = DataLoader(
        stream,
        batch_size=schooling.batch,
        collate_fn=list,
        num_workers=1,
        prefetch_factor=4,
        multiprocessing_context="spawn",
    )
    return drawn_ahead(loader)


def _rate(update: int, schooling: Schooling) -> float:
    """Of the full learning rate: up in a line, down in half a cosine."""
    return min((update + 1) / schooling.warm_up, 0.51 + 0.49 * math.cos(math.pi * update / schooling.updates))


def _varied(lesson: Lesson, rng: np.random.Generator) -> Lesson:
    """The lesson or its mirror image, some looks without their earlier views."""
    lesson = without_earlier_views(lesson, rng.random(len(lesson.views)) < _ALONE)
    return mirrored(lesson) if rng.random() < 0.5 else lesson
