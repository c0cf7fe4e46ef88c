"""Stepping for a long time while homes are swapped, to see that memory does not grow."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from thinknav_sim.homes import generate_home, home_seed
from thinknav_trainer.bench.memory import resident_mb
from thinknav_trainer.bench.stepping import RandomWalkers

_HOMES = 4
_AGENTS = 32
_SIZE = 128
_STEPS_IN_A_SET = 40
# Homes differ in size, and allocators keep what they may need again: the first sets are warming up.
_WARM_UP_SHARE = 0.25
ALLOWED_GROWTH = 0.05


@dataclass(frozen=True)
class Sample:
    """Resident memory after a set of homes: seconds since the start, megabytes, homes used so far."""

    seconds: float
    megabytes: float
    homes: int


def soak(seconds: float) -> Iterator[Sample]:
    """Step until the time is up, every few dozen steps in fresh homes."""
    start, homes = time.monotonic(), 0
    while time.monotonic() - start < seconds:
        walkers = RandomWalkers(
            [generate_home(home_seed("train", homes + index)) for index in range(_HOMES)], _AGENTS, _SIZE
        )
        walkers.walk(_STEPS_IN_A_SET)
        walkers.close()
        del walkers
        homes += _HOMES
        yield Sample(time.monotonic() - start, resident_mb(), homes)


def growth(samples: list[Sample]) -> float:
    """How much memory grew from the middle of the run to its end, as a share: medians of the two halves after warm-up.

    Raises ValueError for too few samples to tell.
    """
    warm = [sample.megabytes for sample in samples[int(len(samples) * _WARM_UP_SHARE) :]]
    if len(warm) < 4:
        raise ValueError(f"{len(samples)} sets of homes are too few to see memory grow; soak for longer")
    middle = len(warm) // 2
    return float(np.median(warm[middle:]) / np.median(warm[:middle]) - 1)
