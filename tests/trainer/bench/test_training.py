"""The figures of training speed: what is measured is what was asked for, each learner in turn and beside."""

import itertools
from pathlib import Path

import pytest
from typer.testing import CliRunner

from thinknav_trainer.bench import training
from thinknav_trainer.bench.figures import Figure
from thinknav_trainer.bench.training import NEVER, speed, training_figures
from thinknav_trainer.cli import app
from thinknav_trainer.config import load_config


@pytest.mark.parametrize("beside", ["false", "true"])
def test_shares_of_the_time_add_up(beside: str) -> None:
    config = load_config("smoke", overrides=(*NEVER, "deterministic=false", f"learn_beside={beside}"))
    figures = {figure.figure: figure.value for figure in speed("some", config, None, repeats=1)}
    assert figures["some.steps_per_s"] > 0
    assert figures["some.think_rate"] == 0
    shares = [value for name, value in figures.items() if ".share_" in name]
    assert len(shares) == 6
    assert sum(shares) == pytest.approx(1, abs=0.02)
    assert min(shares) >= 0
    assert figures["some.share_rendering"] > 0


def test_only_the_parts_that_are_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "speeds", lambda repeats, url: iter([Figure("speeds", 1, "")]))
    monkeypatch.setattr(training, "scaling", lambda repeats: iter([Figure("scaling", 1, "")]))
    for parts in itertools.chain.from_iterable(itertools.combinations(("speed", "scaling"), n) for n in (1, 2)):
        told = [figure.figure for figure in training_figures(1, Path("none"), parts=parts)]
        assert told == [name for part, name in (("speed", "speeds"), ("scaling", "scaling")) if part in parts]


def test_a_part_that_there_is_not_is_refused() -> None:
    told = CliRunner().invoke(app, ["bench", "train", "--part", "all"])
    assert told.exit_code == 2
    assert "not one of speed, peers, latency, scaling" in " ".join(told.output.replace("│", " ").split())
