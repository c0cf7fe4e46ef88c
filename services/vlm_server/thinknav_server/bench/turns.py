"""Things measured in turns: what else the machine does hurts all of them alike, and a ratio is one of neighbours."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

TURNS = 5

Measured = TypeVar("Measured")


def in_turns(measurements: Sequence[Callable[[float], Measured]], seconds: float) -> list[tuple[Measured, ...]]:
    """TURNS rows with one value for each of the measurements, each called with its part of the `seconds`.

    Every other row is measured backwards, so that none always has the fresher machine.
    """
    rows = []
    for turn in range(TURNS):
        order = range(len(measurements)) if turn % 2 == 0 else reversed(range(len(measurements)))
        values = {index: measurements[index](seconds / TURNS) for index in order}
        rows.append(tuple(values[index] for index in range(len(measurements))))
    return rows


def median(values: Sequence[float]) -> float:
    """Of the turns."""
    return float(np.median(values))
