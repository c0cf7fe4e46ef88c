"""Tokens at the HTTP door: refused before a byte of the body is read, and in the contract's form."""

import asyncio
from collections.abc import AsyncIterator

import httpx
import pytest

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import CONTENT_TYPE, Unauthenticated, decode_info
from thinknav_server.hosts import PlannerThread
from thinknav_server.http import create_app
from thinknav_server.intake import Intake
from thinknav_server.planners import ScriptedPlanner
from thinknav_server.service import PlanningService
from thinknav_server.settings import Settings
from thinknav_server.tokens import Tokens

ALICE = "alice-0123456789"
PATHS = [
    "/v1/planner",
    "/v1/subgoals",
    "/v1/embeddings",
    "/",
    "/metrics",
    "/openapi.json",
    "/healthz/",
    "/readyz/../v1",
]


def call(
    method: str, path: str, authorization: str | None, content: AsyncIterator[bytes] | None = None
) -> httpx.Response:
    async def ask() -> httpx.Response:
        service = PlanningService(PlannerThread(ScriptedPlanner(), shipped_text_encoder()), Settings())
        app = create_app(service, Tokens({"alice": ALICE}), Intake(1000, 1000, body_timeout=5.0))
        headers = {"Authorization": authorization} if authorization is not None else {}
        async with service, httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://x") as client:
            return await client.request(method, path, headers=headers, content=content)

    return asyncio.run(ask())


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("authorization", [None, "", "Bearer", "Bearer wrong-0123456789", f"Basic {ALICE}", ALICE])
def test_whoever_has_no_token_gets_in_nowhere(path: str, authorization: str | None) -> None:
    response = call("GET", path, authorization)
    assert response.status_code == 401
    assert response.headers["www-authenticate"] == 'Bearer realm="thinknav"'
    assert response.json()["error"]["code"] == "unauthenticated"
    assert ALICE not in response.text


@pytest.mark.parametrize("authorization", [f"Bearer {ALICE}", f"bearer  {ALICE} "])
def test_whoever_has_one_gets_in(authorization: str) -> None:
    assert call("GET", "/v1/planner", authorization).status_code == 200


@pytest.mark.parametrize("path", ["/healthz", "/readyz"])
def test_load_balancers_need_none(path: str) -> None:
    assert call("GET", path, None).status_code == 200


def test_no_byte_of_a_stranger_s_body_is_read() -> None:
    read = 0

    async def body() -> AsyncIterator[bytes]:
        nonlocal read
        read += 1
        yield b"x"

    assert call("POST", "/v1/subgoals", None, body()).status_code == 401
    assert read == 0


def test_programs_are_told_in_their_language() -> None:
    async def ask() -> bytes:
        service = PlanningService(PlannerThread(ScriptedPlanner(), shipped_text_encoder()), Settings())
        app = create_app(service, Tokens({"alice": ALICE}), Intake(1000, 1000, body_timeout=5.0))
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://x") as client:
            return (await client.get("/v1/planner", headers={"Accept": CONTENT_TYPE})).content

    with pytest.raises(Unauthenticated, match="Authorization: Bearer"):
        decode_info(asyncio.run(ask()))
