"""A run's learning curve in few points, to be kept in a ledger."""

from collections.abc import Mapping, Sequence

import numpy as np

POINTS = 40
CURVES = (
    "success",
    "spl",
    "soft_spl",
    "distance_to_goal",
    "think_rate",
    "think_loops",
    "spinning",
    "agreement_share",
)


def learning_curve(metrics: Sequence[Mapping[str, float]], points: int = POINTS) -> dict[str, list[float | None]]:
    """The lines of a metrics.jsonl as `steps` and the means of CURVES and `reward/…` over at most so many stretches of
    equally many steps; None where nothing was logged.
    """
    if not metrics:
        return {"steps": []}
    names = [*CURVES, *sorted({name for row in metrics for name in row if name.startswith("reward/")})]
    last = max(row["steps"] for row in metrics)
    count = min(points, len(metrics))
    stretches: list[list[Mapping[str, float]]] = [[] for _ in range(count)]
    for row in metrics:
        stretches[min(int(row["steps"] / last * count), count - 1)].append(row)
    stretches = [stretch for stretch in stretches if stretch]
    curve: dict[str, list[float | None]] = {"steps": [float(stretch[-1]["steps"]) for stretch in stretches]}
    for name in names:
        curve[name] = [_mean([row[name] for row in stretch if name in row]) for stretch in stretches]
    return curve


def rounded(value: float) -> float:
    """To five digits, which is more than any of these numbers is worth."""
    return float(f"{value:.5g}")


def _mean(values: Sequence[float]) -> float | None:
    return rounded(float(np.mean(values))) if values else None
