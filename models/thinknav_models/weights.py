"""Files of weights: safetensors that say what they are, and are refused when they are not what they say.

A file holds tensors in half precision, the kind of network they are for, its configuration, and a revision: a hash of
configuration and tensors, which names an embedding space or a planner. Knows no particular network.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

SHIPPED = Path(__file__).parent / "weights"
REVISION_DIGITS = 12

_KEYS = ("kind", "config", "revision")


class WeightsError(ValueError):
    """A file of weights that cannot be used; the message names the file and what is wrong with it."""


@dataclass(frozen=True)
class Weights:
    """A network's configuration and tensors (float32), and the revision that names them."""

    config: dict[str, Any]
    tensors: dict[str, NDArray[np.float32]]
    revision: str


def save_weights(path: Path, kind: str, config: Mapping[str, Any], tensors: Mapping[str, NDArray[Any]]) -> str:
    """Write tensors, rounded to half precision, and return their revision. A file that stood there is replaced whole.

    config: whatever JSON can hold. Raises WeightsError for values that half precision cannot.
    """
    halves = {}
    for name, tensor in tensors.items():
        with np.errstate(over="ignore"):
            halves[name] = np.ascontiguousarray(tensor, dtype=np.float16)
        if not np.isfinite(halves[name]).all():
            raise WeightsError(f"{path}: tensor {name!r} holds values that half precision cannot")
    text = json.dumps(config, sort_keys=True)
    revision = _revision(text, halves)
    content = save(halves, metadata={"kind": kind, "config": text, "revision": revision})
    aside = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    aside.write_bytes(content)
    aside.replace(path)
    return revision


def load_weights(path: Path, kind: str) -> Weights:
    """Read and verify a file of weights. Raises WeightsError."""
    if not path.is_file():
        raise WeightsError(f"there is no file of weights {path}")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            _require_kind(path, metadata, kind)
            stored = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (a file is no mapping)
    except SafetensorError as error:
        raise WeightsError(f"{path} is truncated, or no safetensors file ({error})") from None
    revision = _revision(metadata["config"], stored)
    if revision != metadata["revision"]:
        raise WeightsError(f"{path} is corrupt: its contents hash to {revision}, not to {metadata['revision']}")
    tensors = {name: tensor.astype(np.float32) for name, tensor in stored.items()}
    return Weights(json.loads(metadata["config"]), tensors, revision)


def _require_kind(path: Path, metadata: Mapping[str, str], kind: str) -> None:
    missing = [key for key in _KEYS if key not in metadata]
    if missing:
        raise WeightsError(f"{path} holds no weights of ThinkNav: its metadata lacks {', '.join(missing)}")
    if metadata["kind"] != kind:
        raise WeightsError(f"{path} holds weights of kind {metadata['kind']!r}, not {kind!r}")


def _revision(config: str, tensors: Mapping[str, NDArray[Any]]) -> str:
    digest = hashlib.sha256(config.encode())
    for name, tensor in sorted(tensors.items()):
        digest.update(f"\n{name} {tensor.dtype.str} {tensor.shape}\n".encode())
        digest.update(np.ascontiguousarray(tensor).data)
    return digest.hexdigest()[:REVISION_DIGITS]
