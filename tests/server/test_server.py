"""Where the service listens, and how it tells."""

import gc
import os
import signal
import socket
from pathlib import Path

import pytest
from starlette.applications import Starlette

from thinknav_server.server import bind, run, write_atomically


def test_a_listener_has_a_free_port_and_sends_without_delay() -> None:
    with bind("127.0.0.1", 0) as listener:
        assert listener.getsockname()[1] > 0
        # asyncio sets TCP_NODELAY on connections of such listeners alone
        assert listener.proto == socket.IPPROTO_TCP


def test_a_port_in_use_is_named() -> None:
    with bind("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(OSError, match=f"cannot listen on 127.0.0.1 port {port}: Address already in use; "):
            bind("127.0.0.1", port)


@pytest.mark.parametrize("host", ["192.0.2.1", "no such host", "." * 300])
def test_a_host_that_is_not_ours_is_named(host: str) -> None:
    with pytest.raises(OSError, match=r"cannot listen on .* --host") as raised:
        bind(host, 0)
    assert "\n" not in str(raised.value)


def test_who_is_told_to_stop_while_beginning_drains_and_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    told = []

    async def drain() -> None:
        told.append("drained")

    def stop() -> int:
        os.kill(os.getpid(), signal.SIGTERM)
        return 0

    monkeypatch.setattr(gc, "collect", stop)  # which comes when connections are taken already
    before = signal.signal(signal.SIGTERM, lambda *_: told.append("ended"))  # what uvicorn passes on when it ends
    try:
        with bind("127.0.0.1", 0) as listener:
            run(Starlette(), listener, None, "nothing", drain)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert told == ["drained", "ended"]


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "url"
    path.write_text("old")
    write_atomically(path, "http://127.0.0.1:1")
    assert path.read_text() == "http://127.0.0.1:1"
    assert list(tmp_path.iterdir()) == [path]
