"""Where the service listens, and how it tells."""

import socket
from pathlib import Path

import pytest

from thinknav_server.server import bind, write_atomically


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


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "url"
    path.write_text("old")
    write_atomically(path, "http://127.0.0.1:1")
    assert path.read_text() == "http://127.0.0.1:1"
    assert list(tmp_path.iterdir()) == [path]
