"""Intervals for means, so that no number stands alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit


def bootstrap_interval(
    values: Sequence[float], confidence: float = 0.95, resamples: int = 2_000, seed: int = 0
) -> tuple[float, float]:
    """Percentile bootstrap of the mean: (low, high). Deterministic; raises ValueError for no values."""
    if not values:
        raise ValueError("an interval needs at least one value")
    data = np.asarray(values, float)
    rng = np.random.default_rng(seed)
    means = data[rng.integers(0, len(data), (resamples, len(data)))].mean(axis=1)
    tail = (1 - confidence) / 2
    return float(np.quantile(means, tail)), float(np.quantile(means, 1 - tail))


def student_interval(values: Sequence[float], confidence: float = 0.95) -> tuple[float, float]:
    """Student's interval of the mean, for a few values such as seeds': (low, high). Raises ValueError below two."""
    if len(values) < 2:
        raise ValueError(f"an interval needs at least two values, not {len(values)}")
    data = np.asarray(values, float)
    half = float(stdtrit(len(data) - 1, (1 + confidence) / 2) * data.std(ddof=1) / np.sqrt(len(data)))
    return float(data.mean()) - half, float(data.mean()) + half


def compare_means(
    ours: Sequence[float],
    theirs: Sequence[float],
    ratio: bool,
    confidence: float = 0.95,
    resamples: int = 10_000,
    seed: int = 0,
) -> tuple[float | None, float | None, float | None]:
    """Our mean over theirs (`ratio`) or above theirs, and its percentile bootstrap interval: (value, low, high).

    Both are resampled independently of each other. None where a ratio has no bound, its lower part being zero; no
    interval where either has a single value. Deterministic; raises ValueError for no values.
    """
    if not ours or not theirs:
        raise ValueError("a comparison needs at least one value on either side")

    def compared(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> NDArray[np.float64]:
        if not ratio:
            return ours - theirs
        with np.errstate(divide="ignore", invalid="ignore"):
            quotient: NDArray[np.float64] = ours / theirs
        return quotient[~np.isnan(quotient)]  # nothing over nothing says nothing

    def told(values: NDArray[np.float64], share: float) -> float | None:
        value = float(np.quantile(values, share, method="inverted_cdf")) if len(values) else np.inf
        return value if np.isfinite(value) else None

    rng = np.random.default_rng(seed)
    mean = told(compared(*(np.array([np.mean(values)]) for values in (ours, theirs))), 0.5)
    if min(len(ours), len(theirs)) < 2:
        return mean, None, None
    drawn = [
        np.asarray(values, float)[rng.integers(0, len(values), (resamples, len(values)))].mean(axis=1)
        for values in (ours, theirs)
    ]
    tail = (1 - confidence) / 2
    return mean, told(compared(*drawn), tail), told(compared(*drawn), 1 - tail)
