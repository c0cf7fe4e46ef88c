"""Work for a client that hangs up is cancelled."""

import asyncio
from typing import Any

import pytest
from starlette.requests import Request

from thinknav_server.disconnect import ClientGone, while_connected


def request_that_hears(messages: "asyncio.Queue[dict[str, Any]]") -> Request:
    return Request({"type": "http", "method": "POST", "headers": []}, receive=messages.get)


def test_a_client_that_hangs_up_cancels_its_work() -> None:
    async def test() -> None:
        messages: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        cancelled = asyncio.Event()

        async def work() -> None:
            try:
                await asyncio.sleep(60)
            except asyncio.CancelledError:
                cancelled.set()
                raise

        messages.put_nowait({"type": "http.request", "body": b""})
        asyncio.get_running_loop().call_later(0.01, messages.put_nowait, {"type": "http.disconnect"})
        with pytest.raises(ClientGone):
            await while_connected(request_that_hears(messages), work())
        assert cancelled.is_set()

    asyncio.run(test())


def test_results_and_errors_pass_through() -> None:
    async def test() -> None:
        request = request_that_hears(asyncio.Queue())
        assert await while_connected(request, asyncio.sleep(0, "done")) == "done"

        async def broken() -> None:
            raise KeyError("broken")

        with pytest.raises(KeyError, match="broken"):
            await while_connected(request, broken())
        await asyncio.sleep(0)
        assert len(asyncio.all_tasks()) == 1

    asyncio.run(test())
