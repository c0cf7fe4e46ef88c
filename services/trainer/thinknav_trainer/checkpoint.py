"""Checkpoints: whole, written atomically, and refused where they do not fit.

A file holds weights, optimiser, counters, random generators and the envs' state, as tensors and plain values only, so
that reading one never runs code. Knows nothing of what the states mean.
"""

import pickle
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from thinknav_trainer.errors import UserError
from thinknav_trainer.files import replacing

FORMAT = 2
_ARRAY = "__ndarray__"
# A damaged file is followed wherever its bytes lead, so that reading it ends in almost any of Python's errors.
_UNREADABLE = (
    OSError,
    RuntimeError,
    EOFError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    pickle.UnpicklingError,
)


class CheckpointError(UserError):
    """A checkpoint that is missing, damaged or made for something else; the message names it and says why."""


@dataclass(frozen=True)
class Checkpoint:
    """One moment of a run.

    config: the configuration as plain values. action_space: names of the actions, in order. embedding_space: of the
    thoughts that the policy learnt to read, None for a policy that has none. policy: its weights.
    state: what going on needs beside them; empty where only the policy was kept.
    """

    config: dict[str, Any]
    action_space: tuple[str, ...]
    embedding_space: str | None
    thought_size: int
    steps: int
    policy: dict[str, Any]
    state: dict[str, Any] = field(default_factory=dict)

    def save(self, path: Path) -> None:
        """Write aside, sync, rename: a reader sees the whole file or none."""
        with replacing(path) as file:
            torch.save({"thinknav_checkpoint": FORMAT, **{k: _pack(v) for k, v in vars(self).items()}}, file)

    @classmethod
    def load(cls, path: Path) -> "Checkpoint":
        """Read it. Raises CheckpointError."""
        values = load_tensors(path)
        version = values.pop("thinknav_checkpoint", None) if isinstance(values, dict) else None
        if version != FORMAT:
            raise CheckpointError(f"{path} is not a ThinkNav checkpoint of format {FORMAT} (found {version})")
        try:
            values["action_space"] = tuple(values["action_space"])
            return cls(**{name: _unpack(value) for name, value in values.items()})
        except (TypeError, LookupError) as error:
            raise CheckpointError(f"{path} is a checkpoint that lacks something: {error}") from None

    def require(self, action_space: tuple[str, ...], embedding_space: str | None) -> None:
        """Refuse to go on in another action space or embedding space. Raises CheckpointError that names both."""
        if self.action_space != action_space:
            raise CheckpointError(
                f"the checkpoint's actions are [{', '.join(self.action_space)}], "
                f"here they are [{', '.join(action_space)}]; set think.strategy as it was"
            )
        if self.embedding_space != embedding_space:
            raise CheckpointError(
                f"the checkpoint's policy reads thoughts of embedding space {self.embedding_space}, "
                f"the planner here gives {embedding_space}; start the service with the other text encoder"
            )


def load_tensors(path: Path, only_tensors: bool = True) -> Any:
    """What `torch.save` wrote, wherever, on the CPU. Raises CheckpointError.

    only_tensors: and plain values; without it, reading a file may run code that it holds.
    """
    try:
        return torch.load(path, map_location="cpu", weights_only=only_tensors)
    except FileNotFoundError:
        raise CheckpointError(f"there is no checkpoint {path}") from None
    except _UNREADABLE as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise CheckpointError(f"{path} is no checkpoint, or damaged: {reason}") from None


def _pack(value: Any) -> Any:
    """Arrays become tensors, which the safe reader knows; what is on a GPU is brought here."""
    if isinstance(value, torch.Tensor):
        return value.cpu()
    if isinstance(value, np.ndarray):
        return {_ARRAY: torch.from_numpy(np.ascontiguousarray(value))}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict):
        return {key: _pack(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_pack(item) for item in value]
    return value


def _unpack(value: Any) -> Any:
    if isinstance(value, dict):
        if set(value) == {_ARRAY}:
            return value[_ARRAY].numpy()
        return {key: _unpack(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_unpack(item) for item in value]
    return value
