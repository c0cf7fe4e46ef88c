"""Gives up work for a client that has hung up."""

import asyncio
from collections.abc import Awaitable
from typing import TypeVar

from starlette.requests import Request

T = TypeVar("T")


class ClientGone(Exception):
    """The client hung up before its answer was ready."""


async def while_connected(request: Request, work: Awaitable[T]) -> T:
    """The result of `work`, which is cancelled when the client hangs up. The body must have been read.

    Raises ClientGone then, and whatever the work raises.
    """
    connected = asyncio.timeout(None)  # an end that is set when the client hangs up
    try:
        async with connected:
            watching = asyncio.create_task(_end_when_hung_up(request, connected))
            try:
                return await work
            finally:
                watching.cancel()
    except TimeoutError:
        if connected.expired():
            raise ClientGone from None
        raise


async def _end_when_hung_up(request: Request, connected: asyncio.Timeout) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
    connected.reschedule(asyncio.get_running_loop().time())
