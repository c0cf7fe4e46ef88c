"""Gathers single items into batches for work that is cheaper by the batch.

The queue is bounded and clients take turns: what cannot be served in time is refused at once, and nobody's
requests stand behind all of another's. Items of one key that are asked together are worked on once. Knows
nothing of planners or HTTP, nor where the work is done.
"""

import asyncio
import functools
import logging
import math
import time
from collections.abc import Awaitable, Callable, Hashable, Sequence
from dataclasses import dataclass, field
from itertools import islice
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
    askers: dict[asyncio.Future[Batched[Result]], str] = field(default_factory=dict)  # and which client each is
    arrived: float = field(default_factory=time.monotonic)

    @property
    def is_of_one_client(self) -> bool:
        return all(asker == self.client for asker in self.askers.values())


def _ignore_batch(_size: int, _seconds: float) -> None:
    pass


@dataclass(eq=False)
class _Batch(Generic[Item, Result]):
    """ahead: whether it still waits for a slot. began: when it had one; until then, when it was given to `work`."""

    jobs: Sequence[_Job[Item, Result]]
    ahead: bool
    began: float = field(default_factory=time.monotonic)


class Batcher(Generic[Item, Result]):
    """An async context manager; `submit` works inside it.

    work: called with 1 to max_batch items; gives one result, or a PlannerError, for each. What it raises fails all.
    max_wait: seconds an item may wait for others, while a slot is free; no longer than until as many have come as
        there were lately, so that whoever is alone does not wait. queue_size: items that wait at most.
    slots: batches that are worked on at once. ahead: full batches that `work` is given before a slot is free for them,
        to prepare them; their items count as waiting. abandons: whether work is cancelled that nobody waits for any
        more. on_batch: told the size and seconds of each batch.
    """

    def __init__(
        self,
        work: Callable[[Sequence[Item]], Awaitable[Sequence[Result | PlannerError]]],
        *,
        max_batch: int,
        max_wait: float,
        queue_size: int,
        slots: int = 1,
        ahead: int = 0,
        abandons: bool = False,
        on_batch: Callable[[int, float], None] = _ignore_batch,
    ) -> None:
        self._work = work
        self._max_batch = max_batch
        self._max_wait = max_wait
        self._queue_size = queue_size
        self._slots = slots
        # What is given away ahead cannot make room for others: at least a batch is kept where it can.
        self._ahead = min(ahead, max(0, queue_size // max_batch - 1))
        self._abandons = abandons
        self._on_batch = on_batch
        self._queue: FairQueue[_Job[Item, Result]] = FairQueue()
        self._by_key: dict[Hashable, _Job[Item, Result]] = {}  # those that wait and those being worked on
        self._batch_seconds = 0.0
        self._serving: dict[asyncio.Task[None], _Batch[Item, Result]] = {}  # the oldest first
        self._expected = max_batch  # items that are thought to come before it is worth to begin
        self._open = False

    @property
    def running(self) -> bool:
        """Whether `submit` is served."""
        return self._open

    @property
    def waiting(self) -> int:
        """Items that nobody works on yet."""
        return len(self._queue) + sum(len(batch.jobs) for batch in self._serving.values() if batch.ahead)

    async def __aenter__(self) -> Self:
        self._loop = asyncio.get_running_loop()
        self._looking = False
        self._timer = self._loop.call_later(0, self._begin_batches)
        self._open = True
        return self

    async def __aexit__(self, *_: object) -> None:
        """Refuses what waits and what is being worked on."""
        self._open = False
        self._timer.cancel()
        for job in self._queue.clear():
            self._settle(job, Unavailable("the service is stopping"))
        tasks = tuple(self._serving)
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
        else:
            self._bring_forward(job, client)
        asker = self._loop.create_future()
        job.askers[asker] = client
        patience = self._loop.call_later(deadline, _give_up, asker, deadline)
        try:
            answer = await asker
        finally:
            patience.cancel()
            job.askers.pop(asker, None)
            if not job.askers:  # and nobody else waits for it
                self._abandon(job)
        return Batched(answer.result, answer.queued, shared=True) if shared else answer

    def _bring_forward(self, job: _Job[Item, Result], client: str) -> None:
        """Who asks what stands far back in another's line takes it into his own, where its turn comes sooner."""
        place = self._queue.place(job.client, job)
        if place is not None and self._queue.waiting(client) < place:
            self._queue.discard(job.client, job)
            job.client = client
            self._queue.add(client, job)

    def _abandon(self, job: _Job[Item, Result]) -> None:
        self._queue.discard(job.client, job)
        self._forget(job)
        for task, batch in self._serving.items():
            if self._abandons and job in batch.jobs and not any(other.askers for other in batch.jobs):
                task.cancel()

    def _enqueue(self, item: Item, client: str, key: Hashable | None) -> _Job[Item, Result]:
        job: _Job[Item, Result] = _Job(item, client, key)
        if key is not None:
            self._by_key[key] = job
        self._queue.add(client, job)
        if len(self._queue) == 1 or len(self._queue) >= min(self._expected, self._max_batch):
            self._look_soon()
        return job

    def _admit(self, client: str, deadline: float) -> None:
        if not self._open:
            raise Unavailable("the service is not running")
        waiting = self.waiting
        # With less than a batch ahead it is admitted in any case, or one slow batch would shut the door for good.
        if waiting < min(self._max_batch, self._queue_size):
            return
        full_batches = (waiting - len(self._queue) + self._queue.ahead_of(client)) // self._max_batch
        expected = self._seconds_until_free() + full_batches * self._batch_seconds / self._slots
        retry_after = max(expected, _SHORTEST_RETRY_S)
        if full_batches and expected + self._batch_seconds > deadline:
            raise Overloaded(f"the queue needs {expected:.1f} s, the deadline is {deadline:g} s", retry_after)
        if waiting >= self._queue_size:
            self._make_room_for(client, Overloaded(f"{waiting} requests are waiting, the queue is full", retry_after))

    def _make_room_for(self, client: str, refusal: Overloaded) -> None:
        """A full queue refuses the newest of whoever fills it, be it the newcomer or a client with more in it.

        What another client asks for as well stays.
        """
        crowd, count = self._queue.crowd()
        newest = next((job for job in self._queue.newest(crowd) if job.is_of_one_client), None)
        if newest is None or count <= self._queue.waiting(client) + 1:
            raise refusal
        self._queue.discard(crowd, newest)
        self._settle(newest, refusal)

    def _seconds_until_free(self) -> float:
        if len(self._serving) < self._slots:
            return 0.0
        oldest = next(iter(self._serving.values()))
        return max(0.0, oldest.began + self._batch_seconds - time.monotonic())

    def _look_soon(self) -> None:
        """Once what arrives together with this has arrived as well."""
        if not self._looking:
            self._looking = True
            self._loop.call_soon(self._begin_batches)

    def _begin_batches(self) -> None:
        self._looking = False
        while self._queue and (patience := self._patience()) <= 0:
            batch = _Batch(self._queue.take(self._max_batch), ahead=len(self._serving) >= self._slots)
            task = self._loop.create_task(self._serve(batch))
            self._serving[task] = batch
            task.add_done_callback(functools.partial(self._served, batch))
        if self._queue and patience < math.inf:
            self._timer.cancel()
            self._timer = self._loop.call_later(patience, self._begin_batches)

    def _patience(self) -> float:
        """Seconds until what waits is to be begun, if nothing else comes."""
        full = len(self._queue) >= self._max_batch
        if len(self._serving) >= self._slots + (self._ahead if full else 0):
            return math.inf
        if full or len(self._queue) >= self._expected:
            return 0.0
        oldest = min(job.arrived for job in self._queue.first_in_line())
        return oldest + self._max_wait - time.monotonic()

    def _served(self, batch: _Batch[Item, Result], task: asyncio.Task[None]) -> None:
        for job in batch.jobs:  # only those of a task that was cancelled are not settled yet
            self._settle(job, Unavailable("the service is stopping"))
        del self._serving[task]
        for other in islice(self._serving.values(), self._slots):
            if other.ahead:
                other.ahead, other.began = False, time.monotonic()
        self._expected = len(batch.jobs) + self.waiting
        self._look_soon()

    async def _serve(self, batch: _Batch[Item, Result]) -> None:
        jobs = batch.jobs
        results: Sequence[Result | PlannerError]
        try:
            results = await self._work([job.item for job in jobs])
            if len(results) != len(jobs):
                raise RuntimeError(f"{len(results)} results for {len(jobs)} items")
            seconds = time.monotonic() - batch.began
            self._batch_seconds = (self._batch_seconds + seconds) / 2 if self._batch_seconds else seconds
            self._on_batch(len(jobs), seconds)
        except PlannerError as error:
            results = [error.as_value() for _ in jobs]
        except Exception:
            logger.exception("a batch of %d failed", len(jobs))
            results = [PlannerFailed("the batch failed in the service") for _ in jobs]
        for job, result in zip(jobs, results, strict=True):
            began = batch.began
            self._settle(job, result if isinstance(result, PlannerError) else Batched(result, began - job.arrived))

    def _settle(self, job: _Job[Item, Result], answer: Batched[Result] | PlannerError) -> None:
        self._forget(job)
        for asker in job.askers:
            if asker.done():
                continue
            if isinstance(answer, PlannerError):
                asker.set_exception(answer)
            else:
                asker.set_result(answer)

    def _forget(self, job: _Job[Item, Result]) -> None:
        if job.key is not None and self._by_key.get(job.key) is job:
            del self._by_key[job.key]


def _give_up(asker: asyncio.Future[Batched[Result]], deadline: float) -> None:
    if not asker.done():
        asker.set_exception(DeadlineExceeded(f"no answer within the deadline of {deadline:g} s"))
