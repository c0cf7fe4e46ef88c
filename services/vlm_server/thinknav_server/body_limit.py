"""ASGI middleware that stops reading a body once it is longer than the service accepts.

It trusts no Content-Length: it counts what arrives, so that a body never fills the memory before it is refused.
"""

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from thinknav_proto import InvalidRequest


class BodyLimit:
    """Makes reading a body of more than `max_bytes` raise InvalidRequest in whoever reads it."""

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        declared = dict(scope["headers"]).get(b"content-length", b"")
        received = 0

        async def limited_receive() -> Message:
            nonlocal received
            if declared.isdigit() and int(declared) > self._max_bytes:
                raise self._too_long()
            message = await receive()
            received += len(message.get("body", b""))
            if received > self._max_bytes:
                raise self._too_long()
            return message

        await self._app(scope, limited_receive, send)

    def _too_long(self) -> InvalidRequest:
        return InvalidRequest(f"the body is longer than the limit of {self._max_bytes} bytes; send it in parts")
