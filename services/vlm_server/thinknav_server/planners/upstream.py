"""Calls to an OpenAI-compatible server: one pool of connections, and retries only where they are safe.

A call is repeated when the server cannot have begun to work on it: it was not reached, or it said that it is busy.
One that timed out or failed is not: the server may be at it still, and a second would double its load. Knows nothing
of frames or goals.
"""

import asyncio
import json
import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import aiohttp

from thinknav_proto import Overloaded, PlannerError, PlannerFailed, Unavailable

_ATTEMPTS = 4
_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 5.0
_BUSY = (429, 503)


class Refused(PlannerFailed):
    """The server answered, and will not do this: the status says why."""

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


@dataclass(frozen=True)
class _Answer:
    status: int
    body: str
    retry_after: str | None


class Upstream:
    """An async context manager. url: up to and with "/v1". key: sent as a bearer token, "" for none."""

    def __init__(self, url: str, key: str, connections: int, timeout: float) -> None:
        self._url = url.rstrip("/")
        self._headers = {"Authorization": f"Bearer {key}"} if key else {}
        self._connections = connections
        self._timeout = aiohttp.ClientTimeout(total=timeout, sock_connect=5.0)

    async def __aenter__(self) -> Self:
        self._session = aiohttp.ClientSession(
            headers=self._headers, timeout=self._timeout, connector=aiohttp.TCPConnector(limit=self._connections)
        )
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._session.close()

    async def models(self) -> list[dict[str, Any]]:
        """What the server serves. Raises Unavailable or PlannerFailed."""
        listed = (await self._call("GET", "/models", None, {})).get("data")
        if not isinstance(listed, list):
            raise PlannerFailed(f"{self._url} does not list its models like an OpenAI-compatible server")
        return [model for model in listed if isinstance(model, dict) and "id" in model]

    async def complete(self, body: Mapping[str, object], headers: Mapping[str, str]) -> str:
        """The text of a chat completion. Raises Unavailable, Overloaded, PlannerFailed, or Refused with its status."""
        completion = await self._call("POST", "/chat/completions", body, headers)
        try:
            text = completion["choices"][0]["message"]["content"]
        except (KeyError, IndexError, TypeError):
            raise PlannerFailed(f"{self._url} answered with no completion") from None
        return text if isinstance(text, str) else ""

    async def _call(
        self, method: str, path: str, body: Mapping[str, object] | None, headers: Mapping[str, str]
    ) -> dict[str, Any]:
        pause = _FIRST_PAUSE_S
        for attempt in range(1, _ATTEMPTS + 1):
            answer = await self._try(method, path, body, headers)
            if isinstance(answer, _Answer) and answer.status not in _BUSY:
                return self._content(answer)
            if attempt == _ATTEMPTS:
                break
            await asyncio.sleep(max(random.uniform(0, pause), _asked_pause(answer)))
            pause *= 2
        if isinstance(answer, _Answer):
            raise Overloaded(f"{self._url} is busy ({answer.status})", max(1.0, _asked_pause(answer)))
        raise answer

    async def _try(
        self, method: str, path: str, body: Mapping[str, object] | None, headers: Mapping[str, str]
    ) -> _Answer | PlannerError:
        """The answer, or why the server was not reached; raises for what must not be tried again."""
        try:
            async with self._session.request(method, self._url + path, json=body, headers=headers) as response:
                text = await response.text(errors="replace")  # a proxy's error page may be in any encoding
                return _Answer(response.status, text, response.headers.get("Retry-After"))
        except (aiohttp.ClientConnectorError, aiohttp.ConnectionTimeoutError) as error:
            return Unavailable(f"no model server at {self._url} ({error})")
        except TimeoutError:
            raise PlannerFailed(f"{self._url} did not answer within {self._timeout.total:g} s") from None
        except aiohttp.ClientError as error:
            raise PlannerFailed(f"{self._url} broke off its answer ({type(error).__name__}: {error})") from None

    def _content(self, answer: _Answer) -> dict[str, Any]:
        try:
            content = json.loads(answer.body)
        except ValueError:
            content = None
        if answer.status >= 400:
            hint = "; is the key right?" if answer.status in (401, 403) else ""
            raise Refused(f"{self._url} refused with {answer.status}{hint}: {answer.body[:200]}", answer.status)
        if not isinstance(content, dict):
            raise PlannerFailed(f"{self._url} does not answer like an OpenAI-compatible server: {answer.body[:100]!r}")
        return content


def _asked_pause(answer: _Answer | PlannerError) -> float:
    """Seconds that the server asks to wait, within reason."""
    asked = answer.retry_after if isinstance(answer, _Answer) else None
    return min(float(asked), _LONGEST_PAUSE_S) if asked and asked.isdigit() else 0.0
