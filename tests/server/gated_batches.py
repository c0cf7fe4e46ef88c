"""A batcher whose work waits until a test lets it go on."""

import asyncio
import threading
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from thinknav_proto import PlannerError
from thinknav_server.batcher import Batched, Batcher


class GatedWork:
    """Doubles numbers, one batch for each time that the gate is opened."""

    def __init__(self) -> None:
        self.batches: list[list[int]] = []
        self.began = threading.Semaphore(0)
        self.gate = threading.Semaphore(0)

    def __call__(self, items: Sequence[int]) -> Sequence[int | PlannerError]:
        self.batches.append(list(items))
        self.began.release()
        assert self.gate.acquire(timeout=10)
        return [2 * item for item in items]

    async def wait_until_it_works(self) -> None:
        assert await asyncio.to_thread(self.began.acquire, timeout=10)


def batcher_of(
    work: Callable[[Sequence[int]], Sequence[int | PlannerError]],
    max_batch: int = 4,
    max_wait: float = 0.0,
    queue_size: int = 8,
    slots: int = 1,
    ahead: int = 0,
) -> Batcher[int, int]:
    async def in_a_thread(items: Sequence[int]) -> Sequence[int | PlannerError]:
        return await asyncio.to_thread(work, items)

    return Batcher(in_a_thread, max_batch=max_batch, max_wait=max_wait, queue_size=queue_size, slots=slots, ahead=ahead)


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    async def limited() -> None:
        async with asyncio.timeout(30):
            await test()

    asyncio.run(limited())


def submit(
    batcher: Batcher[int, int], item: int, deadline: float = 30.0, client: str = "", key: str | None = None
) -> asyncio.Task[Batched[int]]:
    return asyncio.create_task(batcher.submit(item, deadline, client, key))


async def settle() -> None:
    """Lets tasks that can run do so."""
    for _ in range(5):
        await asyncio.sleep(0)
