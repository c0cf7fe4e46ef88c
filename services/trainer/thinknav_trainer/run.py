"""A run on disk: `runs/NAME/{config.yaml, metrics.jsonl, timing.jsonl, thoughts.jsonl, tensorboard/, checkpoints/, …}`.

Knows the layout of the folder; nothing of what is learnt.
"""

import json
import logging
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Self, TextIO

import numpy as np
import yaml
from numpy.typing import NDArray
from torch.utils.tensorboard import SummaryWriter

from thinknav_proto import PlannerInfo, SubgoalReply
from thinknav_trainer.checkpoint import Checkpoint, CheckpointError
from thinknav_trainer.config import ConfigError, TrainConfig, parse_config
from thinknav_trainer.dumps import write_dump
from thinknav_trainer.errors import UserError
from thinknav_trainer.files import remove_leftovers, replace_text
from thinknav_trainer.recording import EMBEDDINGS, PLANNER
from thinknav_trainer.thoughts import Thought, embedding_line, embedding_name

logger = logging.getLogger(__name__)

LOGS = ("metrics", "timing", "thoughts", "embeddings", "validation")
BEST = "best.pt"


class RunError(UserError):
    """A run folder that cannot be used; the message says which and what to do."""


class Run:
    """The folder of one run, open for writing."""

    def __init__(self, folder: Path, config: TrainConfig, steps: int) -> None:
        """Open it at a number of steps: what the logs hold beyond it was lost with its weights, and is cut off.

        Checkpoints beyond it, which could not be read, are set aside.
        """
        self.folder = folder
        self.config = config
        for place in (folder, folder / "checkpoints"):
            remove_leftovers(place)
        for unreadable in list_checkpoints(folder):
            if unreadable > checkpoint_path(folder, steps):  # else it would pass for the newest
                unreadable.rename(unreadable.with_suffix(".pt.damaged"))
        replace_text(folder / "config.yaml", yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False))
        self._logs = {name: open_log(folder / f"{name}.jsonl", steps) for name in LOGS}
        known = read_log(folder / EMBEDDINGS)
        self._texts = {row["text"] for row in known if row["text"] is not None}
        self._embeddings = {row["name"] for row in known if row["text"] is None}
        self._tensorboard = SummaryWriter(str(folder / "tensorboard"), purge_step=steps + 1)

    @classmethod
    def create(cls, folder: Path, config: TrainConfig) -> Self:
        """Begin a new run. Raises RunError where there is one already."""
        if (folder / "config.yaml").exists():
            raise RunError(f"{folder} holds a run already; go on with --resume, or give another --name")
        folder.mkdir(parents=True, exist_ok=True)
        return cls(folder, config, steps=0)

    def log(self, steps: int, metrics: Mapping[str, float], timing: Mapping[str, float]) -> None:
        """A line of metrics.jsonl and one of timing.jsonl, and both to TensorBoard; only what is finite.

        Times are apart because they alone differ between two runs that are otherwise the same.
        """
        for name, values in (("metrics", metrics), ("timing", timing)):
            finite = {key: value for key, value in values.items() if math.isfinite(value)}
            self._write(name, {"steps": steps, **finite})
            for key, value in finite.items():
                self._tensorboard.add_scalar(key, value, steps)

    def log_validation(self, steps: int, measures: Mapping[str, float]) -> None:
        """A line of validation.jsonl, and the same to TensorBoard."""
        self._write("validation", {"steps": steps, **measures})
        for key, value in measures.items():
            self._tensorboard.add_scalar(f"validation/{key}", value, steps)

    def log_thoughts(self, steps: int, thoughts: Iterable[Thought]) -> None:
        """A line of thoughts.jsonl for each, and its embedding where that is new."""
        for thought in thoughts:
            self._write("thoughts", {"steps": steps, **thought.line})
            if isinstance(thought.answer, SubgoalReply):
                self._log_embedding(steps, thought.answer.embedding)

    def log_texts(self, steps: int, texts: Mapping[str, NDArray[np.float32]]) -> None:
        """What was embedded beside thoughts, as far as it is new."""
        for text in [text for text in texts if text not in self._texts]:
            self._texts.add(text)
            self._write("embeddings", {"steps": steps, **embedding_line(texts[text], text)})

    def note_planner(self, planner: PlannerInfo) -> None:
        """Who answers in this run."""
        replace_text(self.folder / PLANNER, planner.model_dump_json(indent=2) + "\n")

    def _log_embedding(self, steps: int, embedding: NDArray[np.float32]) -> None:
        name = embedding_name(embedding)
        if name not in self._embeddings:
            self._embeddings.add(name)
            self._write("embeddings", {"steps": steps, **embedding_line(embedding)})

    def _write(self, log: str, record: Mapping[str, Any]) -> None:
        self._logs[log].write(json.dumps(record) + "\n")

    def checkpoint(self, checkpoint: Checkpoint) -> Path:
        """Save, and keep the first (the untrained policy) and the newest ones. The logs reach the disk before it."""
        for log in self._logs.values():
            os.fsync(log.fileno())
        path = checkpoint_path(self.folder, checkpoint.steps)
        checkpoint.save(path)
        for old in list_checkpoints(self.folder)[1 : -self.config.keep_checkpoints]:
            old.unlink()
        return path

    def keep_best(self, checkpoint: Checkpoint) -> None:
        """As checkpoints/best.pt, in the place of the one that was best until now."""
        checkpoint.save(self.folder / "checkpoints" / BEST)

    def dump(self, steps: int, evidence: Mapping[str, Any]) -> Path:
        """Keep what is needed to see once more why a run stopped; the path."""
        path = self.folder / "dumps" / f"{steps:010d}.pt"
        write_dump(path, evidence)
        return path

    def close(self) -> None:
        for log in self._logs.values():
            log.close()
        self._tensorboard.close()


def checkpoint_path(folder: Path, steps: int) -> Path:
    """Where the checkpoint of a step is."""
    return folder / "checkpoints" / f"{steps:010d}.pt"


def list_checkpoints(folder: Path) -> list[Path]:
    """A run's checkpoints, oldest first."""
    return sorted((folder / "checkpoints").glob("[0-9]*.pt"))


def newest_checkpoint(folder: Path) -> Checkpoint:
    """Where a run stopped. Raises RunError where there is nothing to go on from."""
    paths = list_checkpoints(folder)
    if not paths:
        raise RunError(f"{folder} holds no checkpoint to resume from; start it without --resume")
    for path in reversed(paths):
        try:
            return Checkpoint.load(path)
        except CheckpointError as error:
            logger.warning("%s; trying the one before", error)
    raise RunError(f"no checkpoint of {folder} can be read")


def read_metrics(folder: Path) -> list[dict[str, float]]:
    """All lines of a run's metrics.jsonl. Raises RunError."""
    try:
        (folder / "metrics.jsonl").stat()
        return read_log(folder / "metrics.jsonl")
    except OSError as error:
        raise RunError(f"{folder} is no run: cannot read metrics.jsonl ({error.strerror})") from None


def read_config(folder: Path) -> TrainConfig:
    """The configuration that a run began with. Raises RunError."""
    try:
        return parse_config(yaml.safe_load((folder / "config.yaml").read_text()))
    except OSError as error:
        raise RunError(f"{folder} is no run: cannot read config.yaml ({error.strerror})") from None
    except (yaml.YAMLError, ConfigError) as error:
        raise RunError(f"{folder}/config.yaml cannot be used: {error}") from None


def open_log(path: Path, steps: int) -> TextIO:
    """Open for appending, without what lies beyond `steps` and without a line that was cut off."""
    if path.exists():
        kept = [json.dumps(row) + "\n" for row in read_log(path) if row["steps"] <= steps]
        replace_text(path, "".join(kept))
    return path.open("a", buffering=1)


def read_log(path: Path) -> list[dict[str, Any]]:
    """The lines of a log up to the first that was cut off; none where there is no log."""
    rows = []
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            break
        if not isinstance(row, dict) or "steps" not in row:
            break
        rows.append(row)
    return rows
