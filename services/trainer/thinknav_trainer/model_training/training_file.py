"""The file from which the training of a small network goes on where it was stopped. Knows no network."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from thinknav_models.weights import WeightsError
from thinknav_trainer.checkpoint import load_tensors
from thinknav_trainer.files import replacing

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class TrainingFile:
    """A training's checkpoint.

    identity: what it is trained with, but for the length. batches: of the whole training. decay: its last part, over
    which the learning rate falls; until then it does not depend on its length, which may be changed.
    """

    path: Path
    identity: str
    batches: int
    decay: float

    def save(self, done: int, parts: Mapping[str, Any]) -> None:
        """Write what goes on depends on, whole or not at all. done: batches that it has seen."""
        state = {"identity": self.identity, "batches": self.batches, "done": done, **parts}
        with replacing(self.path) as file:
            torch.save(state, file)

    def load(self) -> tuple[int, dict[str, Any]]:
        """How many batches it has seen, and the parts; 0 and none where there is no file.

        Raises WeightsError for a file of another training, CheckpointError for none that can be read.
        """
        if not self.path.is_file():
            return 0, {}
        state: dict[str, Any] = load_tensors(self.path)
        if state.get("identity") != self.identity:
            raise WeightsError(f"{self.path} is of a training with other settings; remove it, or use another folder")
        done, planned = int(state["done"]), int(state.get("batches", self.batches))
        if done > self.batches:
            raise WeightsError(
                f"{self.path} has seen {done} batches already; ask for as many or more, or use another folder"
            )
        if planned != self.batches and done > (1 - self.decay) * min(planned, self.batches):
            raise WeightsError(
                f"{self.path} has seen {done} of {planned} batches, too many to make {self.batches} of them: the "
                "learning rate would have fallen already; use another folder"
            )
        logger.info("going on after batch %d of %d", done, self.batches)
        return done, state
