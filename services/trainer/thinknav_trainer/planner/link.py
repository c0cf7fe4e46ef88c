"""One replica of a planning service as the balancer sees it: bodies there and bodies back, whatever carries them."""

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from typing import Literal, Protocol, TypeVar

T = TypeVar("T")

Question = Literal["subgoal", "embed", "info"]


class Link(Protocol):
    """A way to one replica. Usable from any number of threads."""

    @property
    def name(self) -> str:
        """Which replica, for people."""

    def send(self, question: Question, body: bytes, patience: float) -> "Future[bytes]":
        """The body of the answer, be it an error's, within `patience` seconds. Does not block.

        Fails with Unavailable when the replica cannot be reached or goes, with DeadlineExceeded when it is late.
        """

    def close(self) -> None:
        """Free what it holds."""


def background(call: Callable[[], T], name: str) -> "Future[T]":
    """What the call returns or raises, from a daemon thread of its own.

    Socket timeouts bound neither name resolution nor a peer that sends a byte at a time; whoever waits for the future
    can leave at any time, and the thread holds up nobody.
    """
    outcome: Future[T] = Future()

    def run() -> None:
        try:
            settle(outcome, call())
        except BaseException as error:
            settle_error(outcome, error)

    threading.Thread(target=run, name=name, daemon=True).start()
    return outcome


def settle(outcome: "Future[T]", result: T) -> None:
    """Give a future its result, unless somebody was faster."""
    with contextlib.suppress(InvalidStateError):
        outcome.set_result(result)


def settle_error(outcome: "Future[T]", error: BaseException) -> None:
    """Give a future its error, unless somebody was faster."""
    with contextlib.suppress(InvalidStateError):
        outcome.set_exception(error)
