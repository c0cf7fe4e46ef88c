"""The handshake with a planning service."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from thinknav_proto import PROTOCOL_VERSION, DeadlineExceeded, ProtocolMismatch, Unavailable
from thinknav_trainer.planner.client import PlannerClient
from thinknav_trainer.planner.http_transport import HttpTransport

HANDSHAKE_S = 6.0  # so that a command that finds no planner has said so within ten seconds

T = TypeVar("T")


def connect(url: str, *, timeout: float = 30.0, handshake: float = HANDSHAKE_S) -> PlannerClient:
    """A client of the service at a URL, which has answered who it is within `handshake` seconds in all.

    timeout: seconds for later answers to questions without a deadline of their own.
    Raises Unavailable when nothing answers there, in one line that says how to start a service, and
    ProtocolMismatch when what answers is no planning service of our protocol version.
    """
    transport = HttpTransport(url, timeout=timeout)
    try:
        client = _within(handshake, lambda: PlannerClient(transport))
        version = client.info.protocol_version
        if version != PROTOCOL_VERSION:
            raise ProtocolMismatch(f"the service at {url} speaks protocol version {version}, we {PROTOCOL_VERSION}")
    except DeadlineExceeded:
        transport.close()
        raise Unavailable(
            f"the service at {url} did not say who it is within {handshake:g} s; is it a thinknav-server?"
        ) from None
    except BaseException:
        transport.close()
        raise
    return client


def _within(seconds: float, call: Callable[[], T]) -> T:
    """What the call returns or raises; DeadlineExceeded if that takes longer.

    Socket timeouts do not bound name resolution, nor a server that answers a byte at a time, so the call runs
    in a daemon thread that is left behind when it is late.
    """
    outcome: Future[T] = Future()

    def run() -> None:
        try:
            outcome.set_result(call())
        except BaseException as error:
            outcome.set_exception(error)

    threading.Thread(target=run, name="planner-handshake", daemon=True).start()
    try:
        return outcome.result(timeout=seconds)
    except TimeoutError:
        raise DeadlineExceeded(f"no answer within {seconds:g} s") from None
