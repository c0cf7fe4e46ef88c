"""Figures: what a line of JSON and a table say, and whose turn it is in a measurement."""

import json

import pytest
from rich.console import Console

from thinknav_trainer.bench.figures import Figure, Timing, compared, table, take_turns


def test_a_line_has_the_agreed_keys() -> None:
    figure = compared("sim.256.vs_open3d", 612.345, "frames/s", "Open3D", 70.0)
    assert json.loads(figure.line) == {
        "figure": "sim.256.vs_open3d",
        "value": 612.3,
        "unit": "frames/s",
        "peer": "Open3D",
        "peer_value": 70.0,
        "ratio": 8.75,
    }


def test_a_missing_peer_is_null() -> None:
    line = json.loads(Figure("sim.256.vs_miniworld", 500.0, "frames/s", "MiniWorld is not installed").line)
    assert line["peer"] == "MiniWorld is not installed"
    assert line["peer_value"] is None
    assert line["ratio"] is None


def test_less_time_is_better() -> None:
    assert compared("cpu", 2.0, "ms", "peer", 9.0, lower_is_better=True).ratio == 4.5


def test_the_table_shows_every_figure() -> None:
    console = Console(width=120)
    with console.capture() as captured:
        console.print(table([Figure("one", 1.5, "s"), compared("two", 3.0, "s", "peer", 1.5)]))
    shown = captured.get()
    assert "one" in shown
    assert "two" in shown
    assert "peer" in shown


def test_measurements_take_turns_and_the_first_round_is_dropped() -> None:
    order: list[str] = []

    def action(name: str, seconds: list[float]) -> Timing:
        order.append(name)
        taken = seconds.pop(0)
        return Timing(taken, 2 * taken)

    slow_start, other = [100.0, 1.0, 3.0, 2.0], [50.0, 5.0, 5.0, 8.0]
    timings = take_turns(3, lambda: action("a", slow_start), lambda: action("b", other))
    assert order == ["a", "b"] * 4
    assert timings == [Timing(2.0, 4.0), Timing(5.0, 10.0)]
    with pytest.raises(ValueError, match="at least one repeat"):
        take_turns(0)
