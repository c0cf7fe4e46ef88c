"""Random draws that a home is made of: only additions, products and integer draws, so that every machine agrees."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def stream(seed: int, *path: int) -> np.random.Generator:
    """An independent PCG64 stream for one purpose of one home."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *path])))


def pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    """One of the options, each as likely as the others."""
    return options[int(rng.integers(len(options)))]


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A length between low and high, in whole centimetres."""
    steps = round((high - low) * 100)
    return round(low + int(rng.integers(steps + 1)) / 100, 2)


def chance(rng: np.random.Generator, probability: float) -> bool:
    """True with this probability."""
    return bool(rng.random() < probability)


def shuffled(rng: np.random.Generator, options: Sequence[T]) -> list[T]:
    """The options in random order."""
    return [options[int(index)] for index in rng.permutation(len(options))]
