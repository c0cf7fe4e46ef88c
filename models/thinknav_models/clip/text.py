"""The text half of the small CLIP: a transformer of two layers, in NumPy, so that a planning service needs no torch.

A text's embedding depends on that text alone, to the last bit, whatever texts it is embedded together with.
"""

import functools
import math
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_models.clip.tokens import Vocabulary, split_words, word_parts
from thinknav_models.text_encoder import EmbeddingSpace
from thinknav_models.weights import SHIPPED, load_weights

DIMENSION = 512
CLIP_KIND = "clip"
CLIP_WEIGHTS = SHIPPED / "clip.safetensors"
SPACE_NAME = "thinknav-clip"

NORM_EPSILON = 1e-5
REMEMBERED_TEXTS = 4096

# Texts are padded to a multiple of so many words, and embedded together with others of their length.
_LENGTH_STEP = 4

Floats = NDArray[np.float32]


class ClipTextEncoder:
    """The encoder `thinknav-clip`. Any thread may call it. It remembers the texts that it met last."""

    def __init__(self, config: Mapping[str, Any], tensors: Mapping[str, Floats], revision: str) -> None:
        """Config and tensors as `load_weights` gives them; those of the image half are let be."""
        self._space = EmbeddingSpace(SPACE_NAME, revision)
        self._network = TextNetwork(config["text"], tensors)
        self._remembered: dict[str, Floats] = {}
        self._lock = threading.Lock()

    @classmethod
    def load(cls, path: Path = CLIP_WEIGHTS) -> "ClipTextEncoder":
        """The encoder in a file of weights, by default the shipped one. Raises WeightsError."""
        weights = load_weights(path, CLIP_KIND)
        return cls(weights.config, weights.tensors, weights.revision)

    @property
    def space(self) -> EmbeddingSpace:
        return self._space

    @property
    def dimension(self) -> int:
        return DIMENSION

    def encode(self, texts: Sequence[str]) -> Floats:
        """The embeddings (N, 512) float32, each of length 1, of N texts. A text without words has one too."""
        with self._lock:
            known = {text: self._remembered[text] for text in texts if text in self._remembered}
        unknown = [text for text in dict.fromkeys(texts) if text not in known]
        if unknown:
            fresh = dict(zip(unknown, self._network.embed(unknown), strict=True))
            known |= fresh
            with self._lock:
                self._remembered |= fresh
                while len(self._remembered) > REMEMBERED_TEXTS:
                    del self._remembered[next(iter(self._remembered))]
        embeddings = np.empty((len(texts), DIMENSION), np.float32)
        for row, text in enumerate(texts):
            embeddings[row] = known[text]
        return embeddings


@functools.cache
def shipped_text_encoder() -> ClipTextEncoder:
    """The one encoder of the shipped weights that a process shares. Raises WeightsError."""
    return ClipTextEncoder.load()


class TextNetwork:
    """Word embeddings, pre-norm transformer layers, the mean over words, a projection to the unit sphere."""

    def __init__(self, config: Mapping[str, Any], tensors: Mapping[str, Floats]) -> None:
        self._vocabulary = Vocabulary(config["words"])
        self._heads = int(config["heads"])
        self._buckets = int(config["buckets"])
        self._words = tensors["text.words"]
        self._parts = tensors["text.parts"]
        self._positions = tensors["text.positions"]
        self._projection = tensors["text.projection"]
        self._layers = [
            {name: tensors[f"text.{layer}.{name}"] for name in ("qkv", "qkv_bias", "mix", "up", "up_bias", "down")}
            for layer in range(int(config["layers"]))
        ]

    def embed(self, texts: Sequence[str]) -> Floats:
        """(N, 512) float32, each of length 1, of N texts."""
        split = [split_words(text) for text in texts]
        padded = np.array([-(-len(words) // _LENGTH_STEP) * _LENGTH_STEP for words in split])
        embeddings = np.empty((len(texts), DIMENSION), np.float32)
        for length in np.unique(padded).tolist():
            chosen = np.flatnonzero(padded == length)
            embeddings[chosen] = self._embed([split[row] for row in chosen], length)
        return embeddings

    def _embed(self, texts: list[list[bytes]], length: int) -> Floats:
        width = self._words.shape[1]
        x = np.zeros((len(texts), length, width), np.float32)
        mask = np.zeros((len(texts), length), np.bool_)
        for row, words in enumerate(texts):
            for place, word in enumerate(words):
                x[row, place] = self._word(word)
            x[row, : len(words)] += self._positions[: len(words)]
            mask[row, : len(words)] = True
        unseen = np.where(mask, np.float32(0), np.float32(-1e9))[:, None, None, :]
        for layer in self._layers:
            x += self._attention(layer, _normalized(x), unseen)
            hidden = np.matmul(_normalized(x), layer["up"]) + layer["up_bias"]
            x += np.matmul(np.maximum(hidden, 0), layer["down"])
        x *= mask[..., None]
        mean = x.sum(axis=1) / mask.sum(axis=1, keepdims=True).astype(np.float32)
        output: Floats = np.matmul(_normalized(mean)[:, None], self._projection)[:, 0]
        output /= np.sqrt(np.square(output).sum(axis=1, keepdims=True))
        return output

    def _attention(self, layer: Mapping[str, Floats], x: Floats, unseen: Floats) -> Floats:
        count, length, width = x.shape
        size = width // self._heads
        qkv = np.matmul(x, layer["qkv"]) + layer["qkv_bias"]
        q, k, v = qkv.reshape(count, length, 3, self._heads, size).transpose(2, 0, 3, 1, 4)
        scores = np.matmul(q, k.swapaxes(-1, -2)) * np.float32(1 / math.sqrt(size)) + unseen
        scores -= scores.max(axis=-1, keepdims=True)
        np.exp(scores, out=scores)
        scores /= scores.sum(axis=-1, keepdims=True)
        mixed = np.matmul(scores, v).transpose(0, 2, 1, 3).reshape(count, length, width)
        output: Floats = np.matmul(mixed, layer["mix"])
        return output

    def _word(self, word: bytes) -> Floats:
        number = self._vocabulary.number(word)
        if number is not None:
            known: Floats = self._words[number]
            return known
        parts: Floats = self._parts[word_parts(word, self._buckets)].mean(axis=0)
        return parts


def _normalized(x: Floats) -> Floats:
    """Each vector over its root mean square (its gain is part of the matrix that follows)."""
    scale: Floats = np.square(x).mean(axis=-1, keepdims=True)
    scale += np.float32(NORM_EPSILON)
    np.sqrt(scale, out=scale)
    return x / scale
