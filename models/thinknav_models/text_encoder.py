"""What a text encoder is, and how two sides know that they mean the same one.

Knows no particular encoder; `clip` holds one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class EmbeddingSpace:
    """The identity of an embedding space: embeddings may be compared only within one.

    name: of the encoder. revision: 12 hex digits, a hash of all that its outputs depend on (parameters, weights).
    """

    name: str
    revision: str

    def __str__(self) -> str:
        return f"{self.name}@{self.revision}"


class TextEncoder(Protocol):
    """Turns texts into unit vectors. It may be called from several threads at once."""

    @property
    def space(self) -> EmbeddingSpace:
        """Where its embeddings lie."""

    @property
    def dimension(self) -> int:
        """Of one embedding."""

    def encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """The embeddings (N, dimension) float32, each of length 1, of N texts."""
