"""Gathers single items into batches for work that is cheaper by the batch, in one worker thread.

The queue is bounded: what cannot be served in time is refused at once. Knows nothing of planners or HTTP.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Generic, Self, TypeVar

from thinknav_proto import DeadlineExceeded, Overloaded, PlannerError, PlannerFailed, Unavailable

logger = logging.getLogger(__name__)

Item = TypeVar("Item")
Result = TypeVar("Result")

# Before the first batch has been timed, and for planners too fast to time, a refused client waits this long.
_SHORTEST_RETRY_S = 0.05


@dataclass(frozen=True)
class Batched(Generic[Result]):
    """A result, and the seconds that its item waited before its batch began."""

    result: Result
    queued: float


@dataclass(eq=False)
class _Job(Generic[Item, Result]):
    item: Item
    done: asyncio.Future[Batched[Result] | PlannerError]
    arrived: float = field(default_factory=time.monotonic)


class Batcher(Generic[Item, Result]):
    """An async context manager; `submit` works inside it.

    work: called in the worker thread with 1 to max_batch items; gives one result, or a PlannerError, for each.
    max_wait: seconds an item may wait for others, while the worker is idle. queue_size: items that wait at most.
    """

    def __init__(
        self,
        work: Callable[[Sequence[Item]], Sequence[Result | PlannerError]],
        *,
        max_batch: int,
        max_wait: float,
        queue_size: int,
    ) -> None:
        self._work = work
        self._max_batch = max_batch
        self._max_wait = max_wait
        self._queue_size = queue_size
        self._waiting: dict[_Job[Item, Result], None] = {}  # in order of arrival; any can leave at once
        self._arrival = asyncio.Event()
        self._batch_seconds = 0.0
        self._busy = False
        self._open = False

    @property
    def running(self) -> bool:
        """Whether `submit` is served."""
        return self._open

    @property
    def waiting(self) -> int:
        """Items in the queue, those being worked on not counted."""
        return len(self._waiting)

    async def __aenter__(self) -> Self:
        self._executor = ThreadPoolExecutor(max_workers=1, thread_name_prefix="planner")
        self._worker = asyncio.create_task(self._run(), name="batcher")
        self._open = True
        return self

    async def __aexit__(self, *_: object) -> None:
        """Refuses what still waits, and lets the batch in the worker thread end."""
        self._open = False
        for job in list(self._waiting):
            job.done.set_result(Unavailable("the service is stopping"))
        self._waiting.clear()
        self._worker.cancel()
        await asyncio.gather(self._worker, return_exceptions=True)
        await asyncio.to_thread(self._executor.shutdown)

    async def submit(self, item: Item, deadline: float) -> Batched[Result]:
        """The item's result, within `deadline` seconds.

        Cancelling it frees the item's place. Raises Unavailable, Overloaded, DeadlineExceeded, or the item's error.
        """
        self._admit(deadline)
        job: _Job[Item, Result] = _Job(item, asyncio.get_running_loop().create_future())
        self._waiting[job] = None
        self._arrival.set()
        try:
            async with asyncio.timeout(deadline):
                answer = await job.done
        except TimeoutError:
            raise DeadlineExceeded(f"no answer within the deadline of {deadline:g} s") from None
        finally:
            self._waiting.pop(job, None)
        if isinstance(answer, PlannerError):
            raise answer
        return answer

    def _admit(self, deadline: float) -> None:
        if not self._open:
            raise Unavailable("the service is not running")
        full_batches, _ = divmod(len(self._waiting), self._max_batch)
        expected = (full_batches + self._busy) * self._batch_seconds
        retry_after = max(expected, _SHORTEST_RETRY_S)
        if len(self._waiting) >= self._queue_size:
            raise Overloaded(f"{len(self._waiting)} requests are waiting, the queue is full", retry_after)
        # With less than a batch waiting it is admitted in any case, or one slow batch would shut the door for good.
        if full_batches and expected > deadline:
            raise Overloaded(f"the queue needs {expected:.1f} s, the deadline is {deadline:g} s", retry_after)

    async def _run(self) -> None:
        while True:
            await self._gather()
            jobs = list(self._waiting)[: self._max_batch]
            for job in jobs:
                del self._waiting[job]
            if jobs:
                await self._serve(jobs)

    async def _gather(self) -> None:
        """Waits until there is a batch to begin: a full one, or the oldest item has waited long enough."""
        while not self._waiting:
            self._arrival.clear()
            await self._arrival.wait()
        oldest = next(iter(self._waiting))
        while 0 < len(self._waiting) < self._max_batch:
            patience = oldest.arrived + self._max_wait - time.monotonic()
            if patience <= 0:
                return
            self._arrival.clear()
            try:
                await asyncio.wait_for(self._arrival.wait(), patience)
            except TimeoutError:
                return

    async def _serve(self, jobs: Sequence[_Job[Item, Result]]) -> None:
        began = time.monotonic()
        self._busy = True
        try:
            loop = asyncio.get_running_loop()
            results = await loop.run_in_executor(self._executor, self._work, [job.item for job in jobs])
            if len(results) != len(jobs):
                raise RuntimeError(f"{len(results)} results for {len(jobs)} items")
        except asyncio.CancelledError:
            results = [Unavailable("the service is stopping") for _ in jobs]
            raise
        except Exception:
            logger.exception("a batch of %d failed", len(jobs))
            results = [PlannerFailed("the batch failed in the service") for _ in jobs]
        finally:
            self._busy = False
            self._batch_seconds = time.monotonic() - began
            for job, result in zip(jobs, results, strict=True):
                if not job.done.done():  # its client may have left
                    job.done.set_result(
                        result if isinstance(result, PlannerError) else Batched(result, began - job.arrived)
                    )
