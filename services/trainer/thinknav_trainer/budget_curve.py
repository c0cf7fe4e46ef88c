"""SPL against calls per episode: points that are evaluations of the same episodes, and what one curve gains on another.

Knows records; nothing of policies and pictures.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_trainer.records import EpisodeRecord
from thinknav_trainer.statistics import bootstrap_interval

MEASURES = ("thinks", "think_rate", "success", "spl", "soft_spl", "steps", "planner_seconds")
RESAMPLES = 2_000


@dataclass(frozen=True)
class Point:
    """An evaluation: its name, and its records in the order that all points share."""

    name: str
    records: Sequence[EpisodeRecord]

    def values(self, measure: str) -> NDArray[np.float64]:
        """(E,) of the episodes."""
        return np.array([record.measures[measure] for record in self.records])

    def summary(self) -> dict[str, dict[str, float]]:
        """Mean and 95 % bootstrap interval over episodes of each of MEASURES."""
        rows = {}
        for measure in MEASURES:
            values = self.values(measure)
            low, high = bootstrap_interval(values.tolist())
            rows[measure] = {"mean": float(values.mean()), "low": low, "high": high}
        return rows


@dataclass(frozen=True)
class Curve:
    """Points that belong together, in the order of their calls."""

    name: str
    points: tuple[Point, ...]

    @classmethod
    def of(cls, name: str, points: Sequence[Point]) -> "Curve":
        """Put in order."""
        return cls(name, tuple(sorted(points, key=lambda point: float(point.values("thinks").mean()))))

    def table(self) -> list[dict[str, Any]]:
        """A row for each point."""
        return [{"name": point.name, **point.summary()} for point in self.points]


def gains(curve: Curve, other: Curve, measure: str = "spl") -> list[dict[str, Any]]:
    """By how much each point of a curve lies above another curve at as many calls, with 95 % intervals.

    The other curve is linear between its points; where it does not reach there is no row. Intervals: bootstrap over
    episodes, the same ones resampled in all points, calls and all.
    """
    if not curve.points or not other.points:
        return []
    calls, worth = _table(other, "thinks"), _table(other, measure)
    count = calls.shape[1]
    drawn = np.random.default_rng(0).integers(0, count, (RESAMPLES, count))
    resampled = [(table[:, drawn].mean(axis=2).T) for table in (calls, worth)]
    rows = []
    for point in curve.points:
        own_calls, own_worth = point.values("thinks"), point.values(measure)
        if not calls.mean(axis=1).min() <= own_calls.mean() <= calls.mean(axis=1).max():
            continue
        mean = own_worth.mean() - _at(own_calls.mean(), calls.mean(axis=1), worth.mean(axis=1))
        differences = [
            own - _at(at, xs, ys)
            for own, at, xs, ys in zip(
                own_worth[drawn].mean(axis=1), own_calls[drawn].mean(axis=1), *resampled, strict=True
            )
        ]
        low, high = np.quantile(differences, (0.025, 0.975))
        rows.append({"name": point.name, "mean": float(mean), "low": float(low), "high": float(high)})
    return rows


def _table(curve: Curve, measure: str) -> NDArray[np.float64]:
    """(points, episodes)."""
    return np.stack([point.values(measure) for point in curve.points])


def _at(x: float, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> float:
    order = np.argsort(xs, kind="stable")
    return float(np.interp(x, xs[order], ys[order]))
