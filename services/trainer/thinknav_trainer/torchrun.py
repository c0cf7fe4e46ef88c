"""The workers that torchrun has started, over torch.distributed: gloo for the CPU's tensors, NCCL for CUDA's.

A meeting is what all must come to. When one fails, whoever is first to know why says so, and the others are silent:
a run that ends badly ends with one line. Knows nothing of policies and envs.
"""

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TypeVar

import torch
import torch.distributed as dist
from torch import Tensor
from torch.distributed.distributed_c10d import PrefixStore, Store
from torch.distributed.rendezvous import rendezvous

from thinknav_trainer.config import TrainConfig, parse_config
from thinknav_trainer.heartbeat import Heartbeat
from thinknav_trainer.torchrun_environment import times_restarted
from thinknav_trainer.workers import WorkerLost, Workers

T = TypeVar("T")

CONFIGURATION, FAILURES, ROLLOUTS = "configuration", "failures", "rollouts"
START_TIMEOUT_S = 300.0  # for the first worker to read its configuration, and for all to be there


class Torchrun:
    """This process among the others; see `Workers`."""

    def __init__(self, store: Store, heartbeat: Heartbeat, sync_frac: float) -> None:
        """sync_frac: share of the workers at whose end of a rollout the others stop; above 1: never."""
        self.rank = dist.get_rank()
        self.count = dist.get_world_size()
        self.threads = max(1, _cores() // int(os.environ.get("LOCAL_WORLD_SIZE", "1")))
        self._store = store
        self._heartbeat = heartbeat
        self._enough = sync_frac * self.count
        self._rollouts = 0

    def share(self, make: Callable[[], T]) -> T:
        values = [make() if self.rank == 0 else None]
        with self._meeting():
            dist.broadcast_object_list(values, src=0)
        return values[0]  # type: ignore[return-value]  # the first worker's

    def gather(self, value: T) -> list[T]:
        values = [value] * self.count
        with self._meeting():
            dist.all_gather_object(values, value)
        return values

    def bring(self, value: T) -> list[T]:
        values = [value] * self.count if self.rank == 0 else None
        with self._meeting():
            dist.gather_object(value, values, dst=0)
        return values or []

    def sum(self, values: Tensor) -> Tensor:
        with self._meeting():
            dist.all_reduce(values)
        return values

    def most_are_done(self) -> bool:
        with self._named_failure():
            return bool(self._store.add(f"{ROLLOUTS}/{self._rollouts}", 0) >= self._enough)

    def done(self) -> None:
        with self._named_failure():
            self._store.add(f"{ROLLOUTS}/{self._rollouts}", 1)
            if self.rank == 0 and self._rollouts > 1:  # all have met since, so nobody asks for it any more
                self._store.delete_key(f"{ROLLOUTS}/{self._rollouts - 2}")
        self._rollouts += 1

    @contextmanager
    def _meeting(self) -> Iterator[None]:
        self._heartbeat.came_to_meeting()
        with self._named_failure():
            yield

    @contextmanager
    def _named_failure(self) -> Iterator[None]:
        try:
            yield
        except RuntimeError as failure:  # torch has many kinds of them
            raise self._heartbeat.diagnose(failure) from None


@contextmanager
def torchrun_workers(configure: Callable[[], TrainConfig]) -> Iterator[tuple[Workers, TrainConfig]]:
    """Meet the others; the configuration is the first worker's. Raises WorkerLost."""
    start = timedelta(seconds=START_TIMEOUT_S)
    with _coming_together():
        store, rank, count = next(rendezvous("env://", timeout=start))
    store = PrefixStore(f"thinknav/{times_restarted()}", store)  # what was before a restart is past
    with _one_speaks(store):
        config = _configuration(store, rank, configure)
        patience = config.workers.timeout
        backend = "cpu:gloo,cuda:nccl" if torch.cuda.is_available() else "cpu:gloo"
        patient = timedelta(seconds=patience)
        with _coming_together():
            dist.init_process_group(backend, store=store, rank=rank, world_size=count, timeout=patient)
        with Heartbeat(store, rank, count, patience) as heartbeat:
            never = config.deterministic  # who stops early is a matter of timing
            yield Torchrun(store, heartbeat, 2.0 if never else config.workers.sync_frac), config
        dist.destroy_process_group()


@contextmanager
def _coming_together() -> Iterator[None]:
    try:
        yield
    except RuntimeError as failure:
        reason = (str(failure).splitlines() or ["no reason given"])[0]
        raise WorkerLost(f"the workers have not come together: {reason}") from None


@contextmanager
def _one_speaks(store: Store) -> Iterator[None]:
    """Of several workers that fail, for whatever reason, only the first lets its error through."""
    try:
        yield
    except SystemExit:
        raise
    except BaseException:
        if _failures(store, mine=1) > 1:
            raise SystemExit(1) from None
        raise


def _failures(store: Store, mine: int = 0) -> int:
    try:
        return int(store.add(FAILURES, mine))
    except RuntimeError:  # the store is gone with its host: everybody speaks for himself
        return mine


def _configuration(store: Store, rank: int, configure: Callable[[], TrainConfig]) -> TrainConfig:
    """The first worker's, which it alone reads: the run's folder may be out of the others' reach."""
    if rank == 0:
        config = configure()
        store.set(CONFIGURATION, config.model_dump_json())
        return config
    end = time.monotonic() + START_TIMEOUT_S
    while not store.check([CONFIGURATION]):
        if _failures(store):
            raise WorkerLost("the first worker has failed")
        if time.monotonic() > end:
            raise WorkerLost(f"the first worker has not read its configuration within {START_TIMEOUT_S:g} s")
        time.sleep(0.1)
    return parse_config(json.loads(store.get(CONFIGURATION)))


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
