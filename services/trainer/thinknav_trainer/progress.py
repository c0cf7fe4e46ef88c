"""A progress bar with steps/s and time left: live on a terminal, a line now and then in a log."""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskProgressColumn, TextColumn

from thinknav_trainer.torchrun_environment import own_rank

logger = logging.getLogger(__name__)

LOG_EVERY_S = 15.0

_shown: list[str] = []  # bars of this process, the outermost first


class ProgressBar:
    """Counts `total` units of work."""

    def __init__(self, bar: Progress, title: str, total: int, done: int, unit: str) -> None:
        self._bar = bar
        self._title = title
        self._total = total
        self._start_done = done
        self._unit = unit
        self._start = time.monotonic()
        self._last_line = self._start
        self._task = bar.add_task(title, total=total, completed=done, note="")

    def update(self, done: int, note: str = "") -> None:
        """Work done so far, in all."""
        now = time.monotonic()
        rate = (done - self._start_done) / max(now - self._start, 1e-9)
        left = max(0, self._total - done) / rate if rate else 0.0  # the last update may go beyond
        text = f"{rate:,.{1 if rate < 10 else 0}f} {self._unit}/s, {_duration(left)} left{', ' if note else ''}{note}"
        self._bar.update(self._task, completed=done, note=text)
        if not self._bar.console.is_terminal and now - self._last_line >= LOG_EVERY_S:
            self._last_line = now
            logger.info("%s: %d of %d, %s", self._title, done, self._total, text)


@contextmanager
def progress_bar(title: str, total: int, done: int = 0, unit: str = "steps") -> Iterator[ProgressBar]:
    """Show a bar while the block runs. Log lines of the block appear above it."""
    console = Console(stderr=True)
    # A terminal has room for one live bar, of one worker.
    hidden = not console.is_terminal or bool(_shown) or own_rank() > 0
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), MofNCompleteColumn())
    bar = Progress(*columns, TextColumn("{task.fields[note]}"), console=console, disable=hidden)
    with bar:
        _shown.append(title)
        try:
            yield ProgressBar(bar, title, total, done, unit)
        finally:
            _shown.pop()


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
