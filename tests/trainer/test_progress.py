"""What a progress bar says in a log."""

import logging
from types import SimpleNamespace

import pytest

from thinknav_trainer.progress import progress_bar


def lines(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, *updates: tuple[float, int]) -> list[str]:
    """Of work begun at 100 of 1,000, from (seconds since the beginning, done)."""
    now = 0.0
    monkeypatch.setattr("thinknav_trainer.progress.time", SimpleNamespace(monotonic=lambda: now))
    with caplog.at_level(logging.INFO, logger="thinknav_trainer"), progress_bar("moving", 1000, done=100) as bar:
        for seconds, done in updates:
            now = seconds
            bar.update(done, "well")
    return caplog.messages


@pytest.mark.parametrize(
    ("done", "says"),
    [
        (540, "moving: 540 of 1000, 22 steps/s, 0:21 left, well"),
        (110, "moving: 110 of 1000, 0.5 steps/s, 29:40 left, well"),
        (1010, "moving: 1010 of 1000, 46 steps/s, 0:00 left, well"),
        (100, "moving: 100 of 1000, 0.0 steps/s, 0:00 left, well"),
    ],
)
def test_how_fast_and_how_much_longer(
    done: int, says: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert lines(monkeypatch, caplog, (20, done)) == [says]


def test_a_line_now_and_then(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    told = lines(monkeypatch, caplog, (14, 200), (16, 300), (30, 400), (32, 500))
    assert [line.split(" of ")[0] for line in told] == ["moving: 300", "moving: 500"]
