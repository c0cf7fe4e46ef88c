"""Several processes that train one policy, each with envs of its own: what one of them needs to know of the others.

`Lone` is a run of one process, and does nothing. Knows nothing of how workers reach each other (`torchrun` does), nor
of policies and envs.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar

import numpy as np
from torch import Tensor

from thinknav_trainer.config import TrainConfig
from thinknav_trainer.errors import RunFailure
from thinknav_trainer.torchrun_environment import started_by_torchrun

T = TypeVar("T")


class WorkerLost(RunFailure):
    """Another worker is gone, and the run with it; the message says which one."""


class Workers(Protocol):
    """All workers of a run, as one of them sees them. What all must call in the same order raises WorkerLost.

    rank: this worker's place among `count`; the first (0) writes the run down. threads: for this worker's work, where
    the configuration does not say; 0: as many as there are.
    """

    rank: int
    count: int
    threads: int

    def share(self, make: Callable[[], T]) -> T:
        """What the first worker makes, for all. All call it."""

    def gather(self, value: T) -> list[T]:
        """Everyone's value, by rank. All call it."""

    def bring(self, value: T) -> list[T]:
        """Everyone's value, by rank, for the first worker; nothing for the others. All call it."""

    def sum(self, values: Tensor) -> Tensor:
        """Everyone's values added up, in place. All call it."""

    def most_are_done(self) -> bool:
        """Whether so many have finished the present rollout that the others should stop early."""

    def done(self) -> None:
        """This worker has finished its rollout."""


class Lone:
    """A worker without others."""

    rank = 0
    count = 1
    threads = 0

    def share(self, make: Callable[[], T]) -> T:
        return make()

    def gather(self, value: T) -> list[T]:
        return [value]

    def bring(self, value: T) -> list[T]:
        return [value]

    def sum(self, values: Tensor) -> Tensor:
        return values

    def most_are_done(self) -> bool:
        return False

    def done(self) -> None:
        """Nobody waits."""


def any_of(workers: Workers, mine: bool) -> bool:
    """Whether it is so for any worker: what ends a run ends it for all, after the same update."""
    return any(workers.gather(mine))


def seed_of(seed: int, rank: int, steps: int = 0) -> int:
    """A worker's own seed, far from those of other workers and of other runs; the first worker's is the run's.

    steps: at which the worker joined, so that one that comes to a run later does not begin as another did before it.
    """
    return seed if rank == 0 else int(np.random.SeedSequence((seed, rank, steps)).generate_state(1)[0])


@contextmanager
def join_workers(configure: Callable[[], TrainConfig]) -> Iterator[tuple[Workers, TrainConfig]]:
    """The workers that this process is one of, and the configuration of the first, who alone calls `configure`."""
    if not started_by_torchrun():
        yield Lone(), configure()
        return
    from thinknav_trainer.torchrun import torchrun_workers

    with torchrun_workers(configure) as joined:
        yield joined
