"""Batches that are made ahead of time in processes of their own, which Ctrl-C leaves alone.

A terminal sends it to all of them. Whoever trains ends with a checkpoint, and must not lose its batches before.
"""

import signal
from collections.abc import Iterator
from multiprocessing import resource_tracker
from typing import Any

from torch.utils.data import DataLoader


def drawn_ahead(loader: DataLoader[Any]) -> Iterator[Any]:
    """What a loader with processes gives. They start here, and never hear SIGINT."""
    resource_tracker.ensure_running()  # whose start lets signals through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # processes begin with what is blocked here
    try:
        return iter(loader)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
