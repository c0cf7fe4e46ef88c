"""`thinknav bench train-memory` trains, looks at memory every so many steps, and can tell a leak."""

import json
from collections.abc import Iterator

import pytest
from typer.testing import CliRunner, Result

from thinknav_trainer.bench import training_memory
from thinknav_trainer.cli import app


def watched(megabytes: Iterator[float], monkeypatch: pytest.MonkeyPatch) -> Result:
    """What the command says where memory is what `megabytes` says."""
    monkeypatch.setattr(training_memory, "resident_mb", lambda: next(megabytes))
    short = ["--steps", "512", "--samples", "8", "--preset", "smoke", "--set", "planner.url=privileged"]
    return CliRunner().invoke(app, ["bench", "train-memory", *short])


def test_flat_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    result = watched(iter([90.0, 99.0, *[100.0] * 6]), monkeypatch)
    assert result.exit_code == 0, result.output
    *samples, figure = [json.loads(line) for line in result.stdout.splitlines() if line.startswith("{")]
    assert [sample["steps"] for sample in samples] == list(range(64, 513, 64))
    assert [sample["megabytes"] for sample in samples] == [90.0, 99.0, *[100.0] * 6]
    assert (figure["figure"], figure["value"]) == ("train.memory_growth", 0.0)


def test_growing_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    result = watched(iter([100.0 + 10 * number for number in range(8)]), monkeypatch)
    assert result.exit_code == 1
    assert "GROWS" in result.stderr
