"""Gathers single items into batches for work that is cheaper by the batch.

The queue is bounded and clients take turns: what cannot be served in time is refused at once, and nobody's
requests stand behind all of another's. Items of one key that are asked together are worked on once. Knows
nothing of planners or HTTP, nor where the work is done.
"""

import asyncio
import contextlib
import functools
import logging
import time
from collections.abc import Awaitable, Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Self, TypeVar

from thinknav_proto import DeadlineExceeded, Overloaded, PlannerError, PlannerFailed, Unavailable
from thinknav_server.fair_queue import FairQueue

logger = logging.getLogger(__name__)

Item = TypeVar("Item")
Result = TypeVar("Result")

# Before the first batch has been timed, and for planners too fast to time, a refused client waits this long.
_SHORTEST_RETRY_S = 0.05


@dataclass(frozen=True)
class Batched(Generic[Result]):
    """A result, the seconds that its item waited before its batch began, and whether another had asked for it."""

    result: Result
    queued: float
    shared: bool = False


@dataclass(eq=False)
class _Job(Generic[Item, Result]):
    item: Item
    client: str
    key: Hashable | None
    done: asyncio.Future[Batched[Result] | PlannerError]
    askers: int = 0
    arrived: float = field(default_factory=time.monotonic)


def _ignore_batch(_size: int, _seconds: float) -> None:
    pass


class Batcher(Generic[Item, Result]):
    """An async context manager; `submit` works inside it.

    work: called with 1 to max_batch items; gives one result, or a PlannerError, for each. What it raises fails all.
    max_wait: seconds an item may wait for others, while a slot is free. queue_size: items that wait at most.
    slots: batches that are worked on at once. on_batch: told the size and seconds of each batch.
    """

    def __init__(
        self,
        work: Callable[[Sequence[Item]], Awaitable[Sequence[Result | PlannerError]]],
        *,
        max_batch: int,
        max_wait: float,
        queue_size: int,
        slots: int = 1,
        on_batch: Callable[[int, float], None] = _ignore_batch,
    ) -> None:
        self._work = work
        self._max_batch = max_batch
        self._max_wait = max_wait
        self._queue_size = queue_size
        self._slots = slots
        self._on_batch = on_batch
        self._queue: FairQueue[_Job[Item, Result]] = FairQueue()
        self._by_key: dict[Hashable, _Job[Item, Result]] = {}  # those that wait and those being worked on
        self._arrival = asyncio.Event()
        self._batch_seconds = 0.0
        self._serving: dict[asyncio.Task[None], float] = {}  # and when each began
        self._open = False

    @property
    def running(self) -> bool:
        """Whether `submit` is served."""
        return self._open

    @property
    def waiting(self) -> int:
        """Items in the queue, those being worked on not counted."""
        return len(self._queue)

    async def __aenter__(self) -> Self:
        self._free = asyncio.Semaphore(self._slots)
        self._worker = asyncio.create_task(self._run(), name="batcher")
        self._open = True
        return self

    async def __aexit__(self, *_: object) -> None:
        """Refuses what waits and what is being worked on."""
        self._open = False
        for job in self._queue.clear():
            self._settle(job, Unavailable("the service is stopping"))
        tasks = (self._worker, *self._serving)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def submit(
        self, item: Item, deadline: float, client: str = "", key: Hashable | None = None
    ) -> Batched[Result]:
        """The item's result, within `deadline` seconds.

        client: whose turn it takes. key: equal keys promise equal results; None is equal to none.
        Cancelling it frees the item's place. Raises Unavailable, Overloaded, DeadlineExceeded, or the item's error.
        """
        job = self._by_key.get(key) if key is not None else None
        shared = job is not None
        if job is None:
            self._admit(client, deadline)
            job = self._enqueue(item, client, key)
        job.askers += 1
        try:
            # Unlike `await job.done`, this does not cancel the future for the others who ask for it.
            finished, _ = await asyncio.wait((job.done,), timeout=deadline)
        finally:
            job.askers -= 1
            if not job.askers:
                self._queue.discard(job.client, job)
                if not job.done.done():
                    self._forget(job)
        if not finished:
            raise DeadlineExceeded(f"no answer within the deadline of {deadline:g} s")
        answer = job.done.result()
        if isinstance(answer, PlannerError):
            raise answer
        return Batched(answer.result, answer.queued, shared=True) if shared else answer

    def _enqueue(self, item: Item, client: str, key: Hashable | None) -> _Job[Item, Result]:
        job: _Job[Item, Result] = _Job(item, client, key, asyncio.get_running_loop().create_future())
        if key is not None:
            self._by_key[key] = job
        self._queue.add(client, job)
        self._arrival.set()
        return job

    def _admit(self, client: str, deadline: float) -> None:
        if not self._open:
            raise Unavailable("the service is not running")
        full_batches = self._queue.ahead_of(client) // self._max_batch
        expected = self._seconds_until_free() + full_batches * self._batch_seconds / self._slots
        retry_after = max(expected, _SHORTEST_RETRY_S)
        # With less than a batch ahead it is admitted in any case, or one slow batch would shut the door for good.
        if full_batches and expected + self._batch_seconds > deadline:
            raise Overloaded(f"the queue needs {expected:.1f} s, the deadline is {deadline:g} s", retry_after)
        if len(self._queue) >= self._queue_size:
            self._make_room_for(client, retry_after)

    def _make_room_for(self, client: str, retry_after: float) -> None:
        """A full queue refuses the newest of whoever fills it, be it the newcomer or a client with more in it."""
        refusal = Overloaded(f"{len(self._queue)} requests are waiting, the queue is full", retry_after)
        crowd, count = self._queue.crowd()
        if count <= self._queue.waiting(client) + 1:
            raise refusal
        self._settle(self._queue.pop_newest(crowd), refusal)

    def _seconds_until_free(self) -> float:
        if len(self._serving) < self._slots:
            return 0.0
        return max(0.0, min(self._serving.values()) + self._batch_seconds - time.monotonic())

    async def _run(self) -> None:
        while True:
            await self._free.acquire()
            await self._gather()
            jobs = self._queue.take(self._max_batch)
            if not jobs:
                self._free.release()
                continue
            task = asyncio.create_task(self._serve(jobs))
            self._serving[task] = time.monotonic()
            task.add_done_callback(functools.partial(self._served, jobs))

    def _served(self, jobs: Sequence[_Job[Item, Result]], task: asyncio.Task[None]) -> None:
        for job in jobs:  # only those of a task that was cancelled are not settled yet
            self._settle(job, Unavailable("the service is stopping"))
        del self._serving[task]
        self._free.release()

    async def _gather(self) -> None:
        """Waits until there is a batch to begin: a full one, or the oldest item has waited long enough."""
        while not self._queue:
            self._arrival.clear()
            await self._arrival.wait()
        oldest = min(job.arrived for job in self._queue.first_in_line())
        while 0 < len(self._queue) < self._max_batch:
            patience = oldest + self._max_wait - time.monotonic()
            if patience <= 0:
                return
            self._arrival.clear()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._arrival.wait(), patience)

    async def _serve(self, jobs: Sequence[_Job[Item, Result]]) -> None:
        began = time.monotonic()
        results: Sequence[Result | PlannerError]
        try:
            results = await self._work([job.item for job in jobs])
            if len(results) != len(jobs):
                raise RuntimeError(f"{len(results)} results for {len(jobs)} items")
            seconds = time.monotonic() - began
            self._batch_seconds = (self._batch_seconds + seconds) / 2 if self._batch_seconds else seconds
            self._on_batch(len(jobs), seconds)
        except PlannerError as error:
            results = [error for _ in jobs]
        except Exception:
            logger.exception("a batch of %d failed", len(jobs))
            results = [PlannerFailed("the batch failed in the service") for _ in jobs]
        for job, result in zip(jobs, results, strict=True):
            self._settle(job, result if isinstance(result, PlannerError) else Batched(result, began - job.arrived))

    def _settle(self, job: _Job[Item, Result], answer: Batched[Result] | PlannerError) -> None:
        self._forget(job)
        if not job.done.done():
            job.done.set_result(answer)

    def _forget(self, job: _Job[Item, Result]) -> None:
        if job.key is not None and self._by_key.get(job.key) is job:
            del self._by_key[job.key]
