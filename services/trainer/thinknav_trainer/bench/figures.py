"""A measured figure, and the two ways to show it. Knows nothing of how it was measured."""

import json
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

from rich.table import Column, Table


@dataclass(frozen=True)
class Figure:
    """One number, and what it is held to.

    figure: its name ("sim.256.scan"). unit: "frames/s". peer: what it is compared with, and where that could not be
    measured, how to make it so. peer_value: in the same unit, None where there is nothing to compare with.
    ratio: above 1 where ours is better, None without a peer.
    """

    figure: str
    value: float
    unit: str
    peer: str | None = None
    peer_value: float | None = None
    ratio: float | None = None

    @property
    def line(self) -> str:
        """The figure as one line of JSON."""
        return json.dumps(asdict(self))


def compared(name: str, value: float, unit: str, peer: str, peer_value: float, lower_is_better: bool = False) -> Figure:
    """A figure with a measured peer."""
    ratio = peer_value / value if lower_is_better else value / peer_value
    return Figure(name, rounded(value), unit, peer, rounded(peer_value), rounded(ratio))


def rounded(value: float) -> float:
    """Three digits, and all of those before the point."""
    return round(value, 1) if abs(value) >= 100 else float(f"{value:.3g}")


def table(figures: Sequence[Figure]) -> Table:
    """The figures for people."""
    shown = Table(Column("figure", no_wrap=True), "value", "unit", "peer", "peer's value", "ratio")
    for figure in figures:
        numbers = ["" if number is None else f"{number:g}" for number in (figure.peer_value, figure.ratio)]
        shown.add_row(figure.figure, f"{figure.value:g}", figure.unit, figure.peer or "", *numbers)
    return shown


@dataclass(frozen=True)
class Timing:
    """Medians over repeats: seconds on the clock, and seconds of this process's processors."""

    wall: float
    cpu: float


def take_turns(repeats: int, *actions: Callable[[], Timing]) -> list[Timing]:
    """Each action's medians. They take turns, so that other work on the machine slows all alike; the first is dropped.

    Raises ValueError for less than one repeat.
    """
    if repeats < 1:
        raise ValueError(f"a measurement takes at least one repeat, not {repeats}")
    rounds = [[action() for action in actions] for _ in range(repeats + 1)][1:]
    return [
        Timing(statistics.median(t.wall for t in taken), statistics.median(t.cpu for t in taken))
        for taken in zip(*rounds, strict=True)
    ]


def timed(action: Callable[[], object]) -> Callable[[], Timing]:
    """The action, timed in this process."""

    def run() -> Timing:
        wall, cpu = time.perf_counter(), time.process_time()
        action()
        return Timing(time.perf_counter() - wall, time.process_time() - cpu)

    return run
