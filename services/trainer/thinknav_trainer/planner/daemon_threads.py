"""Calls that run beside their caller, in threads that nobody waits for at the end of the process.

`concurrent.futures.ThreadPoolExecutor` would hold up the interpreter's exit until every call has come back, and a
planner may take its whole deadline.
"""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Generic, TypeVar

T = TypeVar("T")


class DaemonThreads(Generic[T]):
    """At most `limit` calls run at once, the others wait their turn; threads start when they are first needed."""

    def __init__(self, limit: int, name: str) -> None:
        self._limit = limit
        self._name = name
        self._calls: SimpleQueue[tuple[Future[T], Callable[[], T]] | None] = SimpleQueue()
        self._started = 0
        self._unfinished = 0
        self._counting = threading.Lock()

    def submit(self, call: Callable[[], T]) -> Future[T]:
        """The future result of a call."""
        future: Future[T] = Future()
        with self._counting:
            self._unfinished += 1
            start = self._started < min(self._unfinished, self._limit)
            self._started += start
        self._calls.put((future, call))
        if start:
            threading.Thread(target=self._work, name=self._name, daemon=True).start()
        return future

    def close(self) -> None:
        """Let idle threads end. Calls that wait are cancelled; what runs may run on, and is heard no more."""
        with suppress(Empty):
            while True:  # the threads take from it as well
                if (waiting := self._calls.get_nowait()) is not None:
                    waiting[0].cancel()
        for _ in range(self._started):
            self._calls.put(None)

    def _work(self) -> None:
        while (given := self._calls.get()) is not None:
            future, call = given
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(call())
                except BaseException as error:
                    future.set_exception(error)
            with self._counting:
                self._unfinished -= 1
