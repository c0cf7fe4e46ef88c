"""How much a service takes in: the length of a body, the time it may take to arrive, and all bodies at once.

What arrives is counted, whatever a Content-Length claims, so that bodies never fill the memory before they are refused.
"""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from thinknav_proto import InvalidRequest, Overloaded

# Seconds for which a client that is refused while it sends may go on, for at most another body's length: were the
# connection closed at once, its system would throw the answer away unread.
_LINGER_S = 1.0


class Intake:
    """The bytes of bodies that the service holds now, through all its doors.

    max_body_bytes: of one body. max_held_bytes: of all together. body_timeout: seconds for a body to arrive.
    """

    def __init__(self, max_body_bytes: int, max_held_bytes: int, body_timeout: float) -> None:
        self.max_body_bytes = max_body_bytes
        self.body_timeout = body_timeout
        self._max_held_bytes = max_held_bytes
        self._held = 0

    @contextmanager
    def body(self) -> Iterator["Body"]:
        """One body, whose bytes are held until the block ends."""
        body = Body(self)
        try:
            yield body
        finally:
            self._held -= body.length

    def hold(self, length: int) -> None:
        """Raises Overloaded when there is no room."""
        if self._held + length > self._max_held_bytes:
            raise Overloaded(f"the service holds {self._held} bytes of requests and takes no more for now")
        self._held += length


class Body:
    """The part of a body that has arrived."""

    def __init__(self, intake: Intake) -> None:
        self.length = 0
        self._intake = intake

    def check(self, length: int) -> None:
        """Raises InvalidRequest for a body of that length, in bytes, when it is too long."""
        limit = self._intake.max_body_bytes
        if length > limit:
            raise InvalidRequest(f"the body is longer than the limit of {limit} bytes; send it in parts")

    def add(self, length: int) -> None:
        """Count bytes that have arrived. Raises InvalidRequest or Overloaded."""
        self.check(self.length + length)
        self._intake.hold(length)
        self.length += length


class IntakeLimit:
    """ASGI middleware: reading a body that is too long, too slow or too much raises a PlannerError in its reader."""

    def __init__(self, app: ASGIApp, intake: Intake) -> None:
        self._app = app
        self._intake = intake

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        with self._intake.body() as body:
            limited = _LimitedBody(scope, receive, send, self._intake, body)
            await self._app(scope, limited.receive, limited.send)


class _LimitedBody:
    """One request's `receive` and `send` with the limits in between."""

    def __init__(self, scope: Scope, receive: Receive, send: Send, intake: Intake, body: Body) -> None:
        declared = dict(scope["headers"]).get(b"content-length", b"")
        self._declared = int(declared) if declared.isdigit() else 0
        self._receive = receive
        self._send = send
        self._intake = intake
        self._body = body
        self._until = asyncio.get_running_loop().time() + intake.body_timeout
        self._complete = False
        self._refused = False

    async def receive(self) -> Message:
        if self._complete:
            return await self._receive()
        self._refused = True  # unless all of this goes well
        self._body.check(self._declared)
        try:
            async with asyncio.timeout_at(self._until):
                message = await self._receive()
        except TimeoutError:
            raise InvalidRequest(f"the body did not arrive within {self._intake.body_timeout:g} s") from None
        self._body.add(len(message.get("body", b"")))
        self._complete = not message.get("more_body", False)
        self._refused = False
        return message

    async def send(self, message: Message) -> None:
        if self._refused and message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], (b"connection", b"close")]}
        last = message["type"] == "http.response.body" and not message.get("more_body", False)
        if not (last and self._refused):
            await self._send(message)
            return
        await self._send({**message, "more_body": True})
        await self._discard_the_rest()
        await self._send({"type": "http.response.body", "body": b""})

    async def _discard_the_rest(self) -> None:
        patience = self._intake.max_body_bytes
        try:
            async with asyncio.timeout(_LINGER_S):
                while patience > 0:
                    message = await self._receive()
                    if not message.get("more_body", False):
                        break
                    patience -= len(message["body"])
        except TimeoutError:
            pass
