"""Intervals for means, so that no number stands alone."""

from collections.abc import Sequence

import numpy as np
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
