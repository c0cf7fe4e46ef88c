"""Questions over HTTP, one POST for each body of many frames.

Knows URLs, timeouts and status codes; what the answers mean is for the client.
"""

import ssl
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path

import httpx

from thinknav_proto import (
    CONTENT_TYPE,
    DeadlineExceeded,
    EmbedReply,
    EmbedRequest,
    PlannerError,
    PlannerInfo,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
    decode_embed_reply,
    decode_info,
    decode_replies,
    encode_embed_request,
    encode_requests,
)
from thinknav_trainer.planner.link import Question, background

# A proxy before the service answers these by itself when the service is away.
_GATEWAY_STATUSES = (502, 503, 504)

_ROUTES: dict[Question, tuple[str, str]] = {
    "subgoal": ("POST", "/v1/subgoals"),
    "embed": ("POST", "/v1/embeddings"),
    "info": ("GET", "/v1/planner"),
}

MAX_IDLE_CONNECTIONS = 64


class HttpTransport:
    """A service at a URL such as http://127.0.0.1:8765. Raises Unavailable for a URL that is none.

    token: sent as bearer token, unless empty. tls_ca: PEM file of the authority that signed the service's certificate,
    in place of those that are known anyway. connect_timeout: seconds until the connection stands. timeout: seconds for
    the answer to a question without a deadline of its own. grace: seconds beyond the latest deadline of a body, for
    the travel of its bytes. Proxies named in the environment are not used.
    """

    def __init__(
        self,
        url: str,
        *,
        token: str = "",
        tls_ca: Path | None = None,
        connect_timeout: float = 5.0,
        timeout: float = 30.0,
        grace: float = 5.0,
    ) -> None:
        self._url = url.rstrip("/")
        self._connect_timeout = connect_timeout
        self._timeout = timeout
        self._grace = grace
        if not self._url.startswith(("http://", "https://")):
            raise Unavailable(f"{url!r} is not the URL of a planning service; those read http://127.0.0.1:8765")
        headers = {"Accept": CONTENT_TYPE} | ({"Authorization": f"Bearer {token}"} if token else {})
        # As many connections as are asked for: how many requests are under way at once is for the client to limit.
        limits = httpx.Limits(max_connections=None, max_keepalive_connections=MAX_IDLE_CONNECTIONS)
        verify = _authority(tls_ca) if tls_ca else self._url.startswith("https://")
        self._client = httpx.Client(trust_env=False, headers=headers, limits=limits, verify=verify)

    def info(self) -> PlannerInfo:
        return decode_info(self.call("info", b"", self._timeout))

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
        patience = max(request.deadline for request in requests) + self._grace
        return decode_replies(self.call("subgoal", encode_requests(requests), patience))

    def embed(self, request: EmbedRequest) -> EmbedReply:
        return decode_embed_reply(self.call("embed", encode_embed_request(request), self._timeout))

    def close(self) -> None:
        self._client.close()

    def call(self, question: Question, body: bytes, timeout: float) -> bytes:
        """The body of the answer, whatever its status, provided that it speaks our protocol. Raises PlannerError."""
        method, path = _ROUTES[question]
        try:
            response = self._client.request(
                method,
                self._url + path,
                content=body or None,
                headers={"Content-Type": CONTENT_TYPE} if body else {},
                timeout=httpx.Timeout(timeout, connect=min(timeout, self._connect_timeout), pool=self._connect_timeout),
            )
        except (httpx.ConnectError, httpx.ConnectTimeout) as error:
            raise self._unreachable(error) from None
        except (httpx.ReadTimeout, httpx.WriteTimeout):
            raise DeadlineExceeded(f"the service at {self._url} did not answer within {timeout:g} s") from None
        except (httpx.HTTPError, httpx.InvalidURL, UnicodeError, RuntimeError) as error:
            # UnicodeError: a name that no host can have. RuntimeError: closed meanwhile.
            raise Unavailable(f"the service at {self._url} cannot be reached: {_reason(error)}") from None
        if response.headers.get("content-type", "").partition(";")[0].strip().lower() == CONTENT_TYPE:
            return response.content
        if response.status_code in _GATEWAY_STATUSES:
            raise Unavailable(f"a gateway at {self._url} answers {response.status_code}: its service is away")
        raise ProtocolMismatch(f"what answers at {self._url} is no planning service (HTTP {response.status_code})")

    def _unreachable(self, error: httpx.TransportError) -> Unavailable:
        reason = _reason(error)
        if "CERTIFICATE_VERIFY_FAILED" in reason:
            return Unavailable(
                f"the certificate of the service at {self._url} is not trusted ({reason}); "
                "name the file of the authority that signed it, by planner.tls_ca"
            )
        if "[SSL" in reason:
            return Unavailable(
                f"what answers at {self._url} speaks no TLS ({reason}); does its URL begin with http://?"
            )
        return Unavailable(
            f"no planning service at {self._url} ({reason}); start one with: thinknav-server serve --port 8765"
        )


class HttpLink:
    """A replica behind a URL, one daemon thread for each question on its way."""

    def __init__(self, url: str, transport: HttpTransport) -> None:
        self.name = url
        self._transport = transport

    def send(self, question: Question, body: bytes, patience: float) -> "Future[bytes]":
        return background(lambda: self._transport.call(question, body, patience), "planner-http")

    def close(self) -> None:
        self._transport.close()


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


def _authority(tls_ca: Path) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=tls_ca)
    except (OSError, ssl.SSLError) as error:
        reason = error.strerror or str(error)
        raise Unavailable(f"planner.tls_ca: {tls_ca} cannot be used as a PEM file of certificates: {reason}") from None
