"""A text encoder without weights: a sum of fixed random-looking vectors, one a word and one a pair of words.

The 64 bytes of a word's BLAKE2b digest are 512 signs, nearly orthogonal between words, so that texts which
share words lie close and others do not. The same text gives the same bits on every machine and Python
version. It knows nothing of
meaning: "couch" and "sofa" are strangers to it.
"""

import hashlib
import itertools
import json
import re
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from thinknav_models.text_encoder import EmbeddingSpace

DIMENSION = 512

# ASCII letters and digits, and every byte of other characters, whose case is left alone: Python's Unicode
# tables change from version to version, bytes do not.
_WORD = re.compile(rb"[a-z0-9\x80-\xff]+")

# A policy steers by these words, so they outweigh what surrounds them.
_DIRECTIONS = ("left", "right", "forward", "ahead", "back", "backward", "around", "stop")
_FILLERS = ("a", "an", "the", "to", "of")
_DIRECTION_WEIGHT = 3.0
_WORD_WEIGHT = 1.0
_PAIR_WEIGHT = 0.5

_PARAMETERS = {
    "algorithm": "blake2b-512 signs, lower ASCII, fillers dropped",
    "word": _WORD.pattern.decode("ascii"),
    "directions": _DIRECTIONS,
    "fillers": _FILLERS,
    "weights": (_DIRECTION_WEIGHT, _WORD_WEIGHT, _PAIR_WEIGHT),
}
_DIRECTION_WORDS = frozenset(word.encode() for word in _DIRECTIONS)
_FILLER_WORDS = frozenset(word.encode() for word in _FILLERS)


class HashedWords:
    """The encoder `hashed-words`. Stateless; any thread may call it."""

    @property
    def space(self) -> EmbeddingSpace:
        parameters = json.dumps(_PARAMETERS, sort_keys=True).encode()
        return EmbeddingSpace("hashed-words", hashlib.sha256(parameters).hexdigest()[:12])

    @property
    def dimension(self) -> int:
        return DIMENSION

    def encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """The embeddings (N, 512) float32 of N texts. A text without a word has an embedding of its own."""
        embeddings = np.empty((len(texts), DIMENSION), dtype=np.float32)
        for row, text in enumerate(texts):
            embeddings[row] = _embed(text)
        return embeddings


def _embed(text: str) -> NDArray[np.float64]:
    words = [word for word in _WORD.findall(text.encode("utf-8", "replace").lower()) if word not in _FILLER_WORDS]
    total = np.zeros(DIMENSION)  # sums of small multiples of 1/2 are exact, in whatever order
    for word in words:
        total += _signs(word) * (_DIRECTION_WEIGHT if word in _DIRECTION_WORDS else _WORD_WEIGHT)
    for first, second in itertools.pairwise(words):
        total += _signs(first + b" " + second) * _PAIR_WEIGHT
    if not total.any():
        total += _signs(b"")
    length: NDArray[np.float64] = np.sqrt(np.square(total).sum())
    return total / length


@lru_cache(maxsize=4096)
def _signs(feature: bytes) -> NDArray[np.int8]:
    """(512,) int8 of -1 and 1."""
    digest = np.frombuffer(hashlib.blake2b(feature, digest_size=DIMENSION // 8).digest(), dtype=np.uint8)
    signs = np.unpackbits(digest).astype(np.int8) * np.int8(2) - np.int8(1)
    signs.setflags(write=False)
    return signs
