"""ASGI middleware that lets in clients with a token, before a byte of their bodies is read.

Whether the service lives (`/healthz`, `/readyz`) is told to everybody: load balancers ask without tokens.
"""

from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from thinknav_proto import Unauthenticated
from thinknav_server.rendering import render_error
from thinknav_server.tokens import Tokens

PUBLIC_PATHS = ("/healthz", "/readyz")


class Authentication:
    """Names the client in the scope's state, as `client`: by its token, or by its address where there are no tokens."""

    def __init__(self, app: ASGIApp, tokens: Tokens) -> None:
        self._app = app
        self._tokens = tokens

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            name = self._client(scope)
            if name is None and scope["path"] not in PUBLIC_PATHS:
                request = Request(scope)
                response = render_error(request, Unauthenticated(self._reason(request)))
                response.headers["WWW-Authenticate"] = 'Bearer realm="thinknav"'
                await response(scope, receive, send)
                return
            scope.setdefault("state", {})["client"] = name
        await self._app(scope, receive, send)

    def _client(self, scope: Scope) -> str | None:
        if not self._tokens:
            return address(scope)
        scheme, _, token = Request(scope).headers.get("authorization", "").partition(" ")
        return self._tokens.client(token.strip()) if scheme.lower() == "bearer" else None

    @staticmethod
    def _reason(request: Request) -> str:
        if "authorization" not in request.headers:
            return "this service asks for a token; send it as the header Authorization: Bearer <token>"
        return "this service does not know the token"


def address(scope: Scope) -> str:
    """The host that a request comes from."""
    return scope["client"][0] if scope.get("client") else "local"
