"""A planner in a thread of this process: for cheap ones that cannot hang, and for planners made in tests."""

import asyncio
import queue
import threading
from collections.abc import Callable, Sequence
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from thinknav_models import TextEncoder
from thinknav_proto import PlannerError
from thinknav_server.hosts.base import Identity
from thinknav_server.planners.base import Planner
from thinknav_server.thinking import Question, Thinker, Thought

T = TypeVar("T")


class PlannerThread:
    """Calls the planner from one thread, batch after batch.

    The thread is a daemon: a planner that hangs blocks those who ask it, but never the end of the process.
    """

    slots = 1
    ahead = 0
    batch_limit = None
    abandons = False
    restarts = 0

    def __init__(self, planner: Planner, text_encoder: TextEncoder) -> None:
        self._thinker = Thinker(planner, text_encoder)
        self._ready = False

    @property
    def identity(self) -> Identity:
        encoder = self._thinker.text_encoder
        return Identity(self._thinker.planner.identity, encoder.space, encoder.dimension)

    @property
    def ready(self) -> bool:
        return self._ready

    async def __aenter__(self) -> Self:
        self._calls: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        threading.Thread(target=_work, args=(self._calls,), name="planner", daemon=True).start()
        self._ready = True
        return self

    async def __aexit__(self, *_: object) -> None:
        self._ready = False
        self._calls.put(None)

    async def think(self, questions: Sequence[Question]) -> Sequence[Thought | PlannerError]:
        return await self._call(lambda: self._thinker.think([question.request for question in questions]))

    async def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        return await asyncio.to_thread(self._thinker.text_encoder.encode, texts)

    async def _call(self, function: Callable[[], T]) -> T:
        loop = asyncio.get_running_loop()
        future: asyncio.Future[T] = loop.create_future()

        def call() -> None:
            try:
                result = function()
            except Exception as error:
                settle(lambda error=error: future.set_exception(error))  # type: ignore[misc]
            else:
                settle(lambda: future.set_result(result))

        def settle(finish: Callable[[], None]) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(lambda: None if future.done() else finish())

        self._calls.put(call)
        return await future


def _work(calls: "queue.SimpleQueue[Callable[[], None] | None]") -> None:
    while (call := calls.get()) is not None:
        call()
