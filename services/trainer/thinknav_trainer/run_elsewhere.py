"""A run that the first worker writes down, as the other workers have it."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import PlannerInfo
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.dumps import write_dump
from thinknav_trainer.run import checkpoint_path
from thinknav_trainer.thoughts import Thought


class RunElsewhere:
    """Takes what `Run` takes and writes nothing, but for the dump of this worker's own failure."""

    def __init__(self, folder: Path, config: TrainConfig, rank: int) -> None:
        self.folder = folder
        self.config = config
        self._rank = rank

    def log(self, steps: int, metrics: Mapping[str, float], timing: Mapping[str, float]) -> None:
        """The first worker does."""

    def log_validation(self, steps: int, measures: Mapping[str, float]) -> None:
        """The first worker does."""

    def log_thoughts(self, steps: int, thoughts: Iterable[Thought]) -> None:
        """Only the first worker's are kept."""

    def log_texts(self, steps: int, texts: Mapping[str, NDArray[np.float32]]) -> None:
        """Only the first worker's are kept."""

    def note_planner(self, planner: PlannerInfo) -> None:
        """The first worker does."""

    def checkpoint(self, checkpoint: Checkpoint) -> Path:
        """Where the first worker saves it."""
        return checkpoint_path(self.folder, checkpoint.steps)

    def keep_best(self, checkpoint: Checkpoint) -> None:
        """The first worker does."""

    def dump(self, steps: int, evidence: Mapping[str, Any]) -> Path:
        """As that of `Run`, on this worker's host."""
        path = self.folder / "dumps" / f"{steps:010d}-worker{self._rank}.pt"
        write_dump(path, evidence)
        return path

    def close(self) -> None:
        """Nothing is open."""
