"""The client against sockets that misbehave: every failure has its name, and none is an exception of `ask`."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgpack
import numpy as np
import pytest

from thinknav_proto import CONTENT_TYPE, Overloaded, encode_error, encode_info
from thinknav_trainer.planner import (
    DeadlineExceeded,
    Frame,
    HttpTransport,
    PlannerClient,
    PlannerError,
    ProtocolMismatch,
    SubgoalRequest,
    Unavailable,
    connect,
    mock_info,
)

REQUEST = SubgoalRequest(request_id="0", goal="chair", frame=Frame.raw(np.zeros((2, 2, 3), np.uint8)), deadline=0.05)
INFO = encode_info(mock_info())


def http(body: bytes, status: str = "200 OK", kind: str = CONTENT_TYPE) -> bytes:
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    return head.encode() + body


@contextmanager
def server(*answers: bytes | None) -> Iterator[str]:
    """A server that gives each connection the next answer; for None it holds the connection and says nothing."""
    held: list[socket.socket] = []
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            for answer in answers:
                connection, _ = listener.accept()
                held.append(connection)
                if answer is None:
                    continue
                connection.recv(65536)
                connection.sendall(answer)
                connection.close()

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        finally:
            thread.join(timeout=10)
            for connection in held:
                connection.close()


def free_url() -> str:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return f"http://127.0.0.1:{listener.getsockname()[1]}"


def ask_once(answer: bytes | None) -> PlannerError:
    """What the client makes of an answer to its first question, after a good handshake."""
    with server(http(INFO), answer) as url, PlannerClient(HttpTransport(url, grace=0.2)) as client:
        (error,) = client.ask([REQUEST])
        assert client.counts.failed == 1
    assert isinstance(error, PlannerError)
    return error


def test_a_service_that_is_not_there_is_named_with_how_to_start_one() -> None:
    url = free_url()
    with pytest.raises(Unavailable) as raised:
        connect(url)
    message = str(raised.value)
    assert url in message
    assert "thinknav-server serve --port 8765" in message
    assert "\n" not in message


@pytest.mark.parametrize("url", ["", "127.0.0.1:8765", "ftp://host", "http://", "http://[::1", "http://a b:80"])
def test_what_is_no_url_is_unavailable_and_named(url: str) -> None:
    with pytest.raises(Unavailable) as raised:
        connect(url)
    assert url.rstrip("/") in str(raised.value)


def test_an_authority_that_is_none_and_a_host_that_cannot_be_are_told(tmp_path: Path) -> None:
    (tmp_path / "ca.pem").write_text("no certificate")
    for name in ("ca.pem", "gone.pem"):
        with pytest.raises(Unavailable, match=rf"planner\.tls_ca: .*{name} cannot be used"):
            HttpTransport("https://127.0.0.1:1", tls_ca=tmp_path / name)
    with pytest.raises(Unavailable, match="cannot be reached"):
        HttpTransport("http://a..b:80").info()


def test_another_web_server_is_a_mismatch() -> None:
    with server(http(b"<html>", "404 Not Found", "text/html")) as url, pytest.raises(ProtocolMismatch) as raised:
        connect(url)
    assert str(raised.value) == f"what answers at {url} is no planning service (HTTP 404)"


def test_a_service_of_another_version_is_a_mismatch_that_names_both() -> None:
    body = msgpack.packb({"version": 2, "info": {}})
    with server(http(body)) as url, pytest.raises(ProtocolMismatch, match="version 1, the other side 2"):
        connect(url)
    info = encode_info(mock_info().model_copy(update={"protocol_version": 3}))
    with server(http(info)) as url, pytest.raises(ProtocolMismatch, match="speaks protocol version 3, we 1"):
        connect(url)


def test_a_handshake_that_is_never_answered_ends_in_time() -> None:
    with server(None) as url, pytest.raises(Unavailable, match=r"did not say who it is within 0\.2 s"):
        connect(url, handshake=0.2)


def test_proxies_of_the_environment_are_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", free_url())
    monkeypatch.setenv("HTTP_PROXY", free_url())
    monkeypatch.setenv("ALL_PROXY", free_url())
    with server(http(INFO)) as url, connect(url) as client:
        assert client.info == mock_info()


def test_no_answer_is_a_deadline_that_has_passed() -> None:
    error = ask_once(None)
    assert isinstance(error, DeadlineExceeded)
    assert "did not answer within 0.25 s" in str(error)


CASES: list[tuple[bytes, type[PlannerError]]] = [
    (b"", Unavailable),
    (b"not http at all\r\n\r\n", Unavailable),
    (http(INFO)[:-10], Unavailable),
    (http(b"bad gateway", "502 Bad Gateway", "text/plain"), Unavailable),
    (http(b"<html>", "200 OK", "text/html"), ProtocolMismatch),
    (http(b"\xff\xff"), ProtocolMismatch),
    (http(INFO), ProtocolMismatch),
    (http(encode_error(Overloaded("full", 2.0)), "429 Too Many Requests"), Overloaded),
]


@pytest.mark.parametrize(("answer", "kind"), CASES)
def test_a_bad_answer_is_named(answer: bytes, kind: type[PlannerError]) -> None:
    error = ask_once(answer)
    assert type(error) is kind
    assert "\n" not in str(error)


def test_a_service_that_dies_is_unavailable_afterwards() -> None:
    with server(http(INFO)) as url:
        client = connect(url)
    with client:
        (error,) = client.ask([REQUEST])
        assert isinstance(error, Unavailable)
        with pytest.raises(Unavailable, match="no planning service"):
            client.embed(["find a chair"])
