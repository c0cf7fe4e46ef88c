"""Ctrl-C and SIGTERM, taken at a safe moment: a run finishes its update, saves, and ends. A second one ends at once."""

import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

logger = logging.getLogger(__name__)


class Interruption:
    """Whether the user wants the run to end, and the exit status that says so."""

    def __init__(self) -> None:
        self.requested = False
        self.exit_code = 0

    def request(self, signal_number: int) -> None:
        self.requested = True
        self.exit_code = 128 + signal_number


@contextmanager
def interruption() -> Iterator[Interruption]:
    """While the block runs, the first signal is noted and the second raises KeyboardInterrupt."""
    noted = Interruption()

    def handle(signal_number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        if noted.requested:
            raise KeyboardInterrupt
        noted.request(signal_number)
        logger.warning("%s: ending after this update; once more to end at once", signal.Signals(signal_number).name)

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield noted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
