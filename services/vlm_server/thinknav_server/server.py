"""Runs the application in uvicorn on a listening socket, and announces where.

Knows nothing of planners; what is served is an ASGI application and a phrase that names it.
"""

import asyncio
import contextlib
import gc
import ipaddress
import logging
import os
import signal
import socket
import ssl
import sys
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import FrameType

import typer
import uvicorn
from starlette.types import ASGIApp

from thinknav_server.http_protocol import BoundedHttpProtocol
from thinknav_server.tokens import Tokens

logger = logging.getLogger(__name__)

Drain = Callable[[], Awaitable[None]]

# Seconds that connections are given to close when all requests are answered, or have been given up.
_CLOSING_S = 2
# Objects that are made, more than are freed, between two looks for garbage. Python's 700 are a few requests: a sixth of
# the time went into looking through the same libraries again.
_GARBAGE_THRESHOLD = 10_000
# Longer than clients keep idle connections (httpx: 5 s), so that none is closed just as its client uses it again.
KEEP_ALIVE_S = 30


def bind(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 picks a free one. Raises OSError with one line that says what to do."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # The protocol is named because asyncio turns Nagle's algorithm off, which holds replies back for 40 ms, for
    # no other listeners.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        if os.name == "posix":  # elsewhere it would let two services share a port
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(2048)
    except (OSError, UnicodeError) as error:
        listener.close()
        reason = (error.strerror if isinstance(error, OSError) else "not a host name") or str(error)
        raise OSError(f"cannot listen on {host} port {port}: {reason}; try others by --host and --port") from None
    return listener


def tls_context(certificate: Path, key: Path | None) -> ssl.SSLContext:
    """TLS for a listener. key: of the certificate, where its file does not hold it too. Raises ValueError."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    files = f"the certificate {certificate}" + (f" with the key {key}" if key else "")

    def no_password() -> str:
        raise ValueError(f"{files}: the key asks for a password; give one without")

    try:
        context.load_cert_chain(certificate, key, no_password)
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).replace("_", " ").lower()
        raise ValueError(f"cannot use {files}: {reason}; both must be in PEM form and belong together") from None
    except OSError as error:
        raise ValueError(f"cannot read {files}: {error.strerror}") from None
    return context


def check_exposure(address: str, tokens: Tokens, encrypted: bool, insecure: bool) -> None:
    """Raises ValueError when others than this machine could ask without a token, unless that is wanted."""
    if ipaddress.ip_address(address).is_loopback:
        return
    if not tokens and not insecure:
        raise ValueError(
            f"listening on {address} lets everybody who reaches it ask the planner; name the clients that may "
            "with --token-file, or say --insecure"
        )
    if not tokens:
        logger.warning("listening on %s: whoever reaches it may ask the planner", address)
    elif not encrypted:
        logger.warning("listening on %s: tokens and frames cross the network in the clear; see --tls-cert", address)


def run(
    app: ASGIApp,
    listener: socket.socket,
    announce: Path | None,
    what: str,
    drain: Drain,
    tls: ssl.SSLContext | None = None,
) -> None:
    """Serve until SIGINT or SIGTERM, then drain; a second signal ends at once.

    announce: a file that holds the URL from the moment requests are accepted until the service stops.
    drain: called when the service is told to stop, while it still listens; when it returns, all connections close.
    """
    address, port = listener.getsockname()[:2]
    ip = ipaddress.ip_address(address)
    host = "127.0.0.1" if ip.is_unspecified else f"[{address}]" if ip.version == 6 else address
    config = uvicorn.Config(
        app,
        http=BoundedHttpProtocol,
        log_config=None,
        access_log=False,
        timeout_keep_alive=KEEP_ALIVE_S,
        timeout_graceful_shutdown=_CLOSING_S,
        proxy_headers=False,  # a client's address is the one it connects from, not one that it claims
        ssl_context_factory=None if tls is None else lambda _config, _default: tls,
    )
    scheme = "http" if tls is None else "https"
    try:
        _Server(config, f"{scheme}://{host}:{port}", announce, what, drain).run(sockets=[listener])
    finally:
        if announce:
            announce.unlink(missing_ok=True)


def stop_at_end_of_input() -> None:
    """Stop this process, as SIGTERM does, when standard input ends: whoever holds its other end has died or let go."""

    def watch() -> None:
        while os.read(sys.stdin.fileno(), 1024):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="until-eof", daemon=True).start()


class _Server(uvicorn.Server):
    """A uvicorn server that tells where it serves as soon as it accepts requests, and drains before it stops."""

    def __init__(self, config: uvicorn.Config, url: str, announce: Path | None, what: str, drain: Drain) -> None:
        super().__init__(config)
        self._url = url
        self._announce = announce
        self._what = what
        self._drain = drain
        self._told_to_stop = threading.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        self._loop = asyncio.get_running_loop()
        await super().startup(sockets)
        gc.collect()
        gc.freeze()  # what is there now stays
        gc.set_threshold(_GARBAGE_THRESHOLD, *gc.get_threshold()[1:])
        typer.echo(f"serving {self._what} at {self._url}")
        if self._announce:
            write_atomically(self._announce, self._url)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if self._told_to_stop.is_set() or not self.started:
            super().handle_exit(sig, frame)
            return
        self._told_to_stop.set()

        def drain_then_exit() -> None:
            draining = asyncio.ensure_future(self._drain())
            draining.add_done_callback(lambda _: uvicorn.Server.handle_exit(self, sig, frame))

        self._loop.call_soon_threadsafe(drain_then_exit)


def write_atomically(path: Path, text: str) -> None:
    """Write a file that readers see whole or not at all."""
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with contextlib.ExitStack() as undo:
        undo.callback(partial.unlink, missing_ok=True)
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
