"""A run on disk: `runs/NAME/{config.yaml, metrics.jsonl, thoughts.jsonl, tensorboard/, checkpoints/}`.

Knows the layout of the folder; nothing of what is learnt.
"""

import json
import logging
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TextIO

import yaml
from torch.utils.tensorboard import SummaryWriter

from thinknav_trainer.checkpoint import Checkpoint, CheckpointError
from thinknav_trainer.config import ConfigError, TrainConfig, parse_config

logger = logging.getLogger(__name__)


class RunError(ValueError):
    """A run folder that cannot be used; the message says which and what to do."""


class Run:
    """The folder of one run, open for writing."""

    def __init__(self, folder: Path, config: TrainConfig, steps: int) -> None:
        """Open it at a number of steps: what the logs hold beyond it was lost with its weights, and is cut off."""
        self.folder = folder
        self.config = config
        (folder / "config.yaml").write_text(yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False))
        self._metrics = _open_log(folder / "metrics.jsonl", steps)
        self._thoughts = _open_log(folder / "thoughts.jsonl", steps)
        self._tensorboard = SummaryWriter(str(folder / "tensorboard"), purge_step=steps + 1 if steps else None)

    @classmethod
    def create(cls, folder: Path, config: TrainConfig) -> "Run":
        """Begin a new run. Raises RunError where there is one already."""
        if (folder / "config.yaml").exists():
            raise RunError(f"{folder} holds a run already; go on with --resume, or give another --name")
        folder.mkdir(parents=True, exist_ok=True)
        return cls(folder, config, steps=0)

    def log(self, steps: int, metrics: Mapping[str, float]) -> None:
        """One line of metrics.jsonl, and the same to TensorBoard. Values that are not finite are left out."""
        finite = {name: value for name, value in metrics.items() if math.isfinite(value)}
        _write(self._metrics, {"steps": steps, **finite})
        for name, value in finite.items():
            self._tensorboard.add_scalar(name, value, steps)

    def log_thoughts(self, steps: int, thoughts: Iterable[Mapping[str, Any]]) -> None:
        """One line of thoughts.jsonl for each."""
        for thought in thoughts:
            _write(self._thoughts, {"steps": steps, **thought})

    def checkpoint(self, checkpoint: Checkpoint) -> Path:
        """Save, and keep the first (the untrained policy) and the newest ones."""
        path = checkpoint_path(self.folder, checkpoint.steps)
        checkpoint.save(path)
        for old in list_checkpoints(self.folder)[1 : -self.config.keep_checkpoints]:
            old.unlink()
        return path

    def close(self) -> None:
        self._metrics.close()
        self._thoughts.close()
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
        text = (folder / "metrics.jsonl").read_text()
    except OSError as error:
        raise RunError(f"{folder} is no run: cannot read metrics.jsonl ({error.strerror})") from None
    return [json.loads(line) for line in text.splitlines()]


def read_config(folder: Path) -> TrainConfig:
    """The configuration that a run began with. Raises RunError."""
    try:
        return parse_config(yaml.safe_load((folder / "config.yaml").read_text()))
    except OSError as error:
        raise RunError(f"{folder} is no run: cannot read config.yaml ({error.strerror})") from None
    except (yaml.YAMLError, ConfigError) as error:
        raise RunError(f"{folder}/config.yaml cannot be used: {error}") from None


def _open_log(path: Path, steps: int) -> TextIO:
    """Open for appending, without what lies beyond `steps` and without a line that was cut off."""
    kept = []
    if path.exists():
        for line in path.read_text().splitlines():
            try:
                if json.loads(line)["steps"] <= steps:
                    kept.append(line + "\n")
            except (json.JSONDecodeError, KeyError, TypeError):
                break
    path.write_text("".join(kept))
    return path.open("a", buffering=1)


def _write(file: TextIO, record: Mapping[str, Any]) -> None:
    file.write(json.dumps(record) + "\n")
