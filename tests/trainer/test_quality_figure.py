"""SPL against the planner's quality: drawn from what the ledger has of the privileged arms."""

import re
from typing import Any

import pytest

from thinknav_trainer.experiments import named_experiment
from thinknav_trainer.experiments.quality_figure import draw_quality

SINGLE = named_experiment("single")


def line(arm: str, seed: int, spl: float, masked: float | None = None) -> dict[str, Any]:
    told = {"arm": arm, "seed": seed, "agent": None, "measures": {"spl": spl}}
    return told | {"masked": None if masked is None else {"spl": masked}}


LINES = [
    line("privileged-0.3", 0, 0.3, 0.3),
    line("privileged", 0, 0.9, 0.1),
    line("privileged", 1, 0.7, 0.0),
    line("never", 0, 0.25),
    line("agent-paper", 0, 0.2, 0.0),
]


def dots(svg: str) -> list[tuple[float, float]]:
    """Where the markers of the seeds are, from left to right and then down."""
    uses = re.findall(r'<g clip-path="[^"]+">\s*((?:<use [^>]*/>\s*)+)</g>', svg)
    places = (re.findall(r'x="([\d.]+)" y="([\d.]+)"', group) for group in uses)
    return sorted((float(x), float(y)) for group in places for x, y in group)


def test_seeds_are_where_their_quality_and_spl_are() -> None:
    drawn = draw_quality(SINGLE, LINES)
    assert drawn is not None
    svg = drawn["svg"].decode()
    for words in ("as it is", "with its thoughts masked", "never: no planner", "10%", "30%"):
        assert words in svg
    seeds = dots(svg)
    assert len(seeds) == 6  # three runs, twice; the paper's agent asks another planner
    (left, best), (_, second), (_, low), (_, lowest), (right, same), (_, again) = seeds
    assert [x for x, _ in seeds] == [left] * 4 + [right] * 2
    assert same == again
    # 0.9, 0.7, 0.1 and 0.0, in a picture whose y goes down.
    assert [(y - best) / (lowest - best) for y in (second, low)] == pytest.approx([0.2 / 0.9, 0.8 / 0.9], abs=0.01)
    assert drawn["png"].startswith(b"\x89PNG")


def test_nothing_to_draw_of_one_quality() -> None:
    assert draw_quality(SINGLE, LINES[1:]) is None
    assert draw_quality(named_experiment("five"), LINES) is None


def test_what_was_not_played_without_thoughts_has_no_dot() -> None:
    drawn = draw_quality(SINGLE, [line("privileged", 0, 0.9), line("privileged-0.3", 0, 0.3, 0.3)])
    assert drawn is not None
    assert len(dots(drawn["svg"].decode())) == 3
