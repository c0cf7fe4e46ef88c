"""What was at hand when a number was not finite, on disk: enough to see it happen again.

A dump of an update holds the policy, the optimiser and the minibatch, and `redo` goes through it once more; one
of an observation or a reward holds what the simulator gave.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from thinknav_trainer.checkpoint import CheckpointError, load_tensors
from thinknav_trainer.errors import RunFailure
from thinknav_trainer.files import replacing


class NotFinite(RuntimeError):
    """A number is NaN or infinite: the message says which and where, `evidence` holds what led to it."""

    def __init__(self, message: str, evidence: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.evidence = dict(evidence)


class TrainingDiverged(RunFailure):
    """A run stopped because of a number that is not finite; the message says which, where, and where the dump lies."""


def write_dump(path: Path, evidence: Mapping[str, Any]) -> None:
    """Write it whole or not at all."""
    with replacing(path) as file:
        torch.save(dict(evidence), file)


def read_dump(path: Path) -> dict[str, Any]:
    """What `write_dump` wrote, wherever: tensors on the CPU, arrays and plain values. Raises CheckpointError.

    For files of one's own only: reading one may run code.
    """
    evidence = load_tensors(path, only_tensors=False)
    if not isinstance(evidence, dict) or "what" not in evidence:
        raise CheckpointError(f"{path} is no dump: it does not say what was not finite")
    return evidence
