"""Stepping for a long time while homes are swapped, to see that memory does not grow."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

from thinknav_sim.homes import generate_home, home_seed
from thinknav_trainer.bench.memory import resident_mb
from thinknav_trainer.bench.stepping import RandomWalkers

_HOMES = 4
_AGENTS = 32
_SIZE = 128
_STEPS_IN_A_SET = 40


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
