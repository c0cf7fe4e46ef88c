"""Bodies that no client would send, at both doors: each is answered in the contract's form, and none as a failure.

FUZZ_CASES sets how many there are of each kind; `make fuzz` asks for 100,000 in all.
"""

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import msgpack
import numpy as np
import pytest
import simplejpeg
import zenoh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import (
    CONTENT_TYPE,
    EmbedRequest,
    Frame,
    InvalidRequest,
    Limits,
    PlannerError,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
    decode_embed_reply,
    decode_replies,
    embed_key,
    encode_embed_request,
    encode_requests,
    subgoal_key,
)
from thinknav_server.hosts import PlannerThread
from thinknav_server.http import create_app
from thinknav_server.intake import Intake
from thinknav_server.planners import ScriptedPlanner
from thinknav_server.service import PlanningService
from thinknav_server.settings import DoorSettings, Settings
from thinknav_server.tokens import Tokens
from thinknav_server.zenoh_door import ZenohDoor
from thinknav_server.zenoh_session import open_session

CASES = int(os.environ.get("FUZZ_CASES", "60"))
TIMEOUT_S = 60.0
LIMITS = Limits(max_frames=8, max_pixels=64 * 64, max_body_bytes=20_000, max_text_length=50, max_texts=8)

Ask = Callable[[str, bytes], bytes]

fuzz = settings(
    max_examples=CASES,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


@pytest.fixture(scope="module")
def runner() -> Iterator[asyncio.Runner]:
    with asyncio.Runner() as runner:
        yield runner


@pytest.fixture(scope="module")
def intake() -> Intake:
    return Intake(LIMITS.max_body_bytes, 10 * LIMITS.max_body_bytes, body_timeout=30.0)


@pytest.fixture(scope="module")
def service(runner: asyncio.Runner) -> Iterator[PlanningService]:
    service = PlanningService(PlannerThread(ScriptedPlanner(), shipped_text_encoder()), Settings(limits=LIMITS))
    runner.run(service.__aenter__())
    yield service
    runner.run(service.__aexit__(None, None, None))


@pytest.fixture(scope="module")
def over_http(runner: asyncio.Runner, service: PlanningService, intake: Intake) -> Ask:
    transport = httpx.ASGITransport(create_app(service, Tokens({}), intake), raise_app_exceptions=False)
    client = httpx.AsyncClient(transport=transport, base_url="http://service", headers={"Content-Type": CONTENT_TYPE})

    async def ask(path: str, body: bytes) -> bytes:
        async with asyncio.timeout(TIMEOUT_S):
            response = await client.post(f"/v1/{path}", content=body)
        assert response.status_code < 500, response.content
        assert response.headers["content-type"] == CONTENT_TYPE
        return response.content

    return lambda path, body: runner.run(ask(path, body))


@pytest.fixture(scope="module")
def over_zenoh(runner: asyncio.Runner, service: PlanningService, intake: Intake) -> Iterator[Ask]:
    doors = DoorSettings(zenoh=f"127.0.0.1:{free_port()}")
    door = ZenohDoor(open_session(doors, Tokens({}), LIMITS.max_body_bytes), service, intake, "fuzzed")
    runner.run(door.__aenter__())
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", f'["tcp/{doors.zenoh}"]')
    config.insert_json5("mode", '"client"')
    config.insert_json5("scouting/multicast/enabled", "false")
    keys = {"subgoals": subgoal_key("fuzzed"), "embeddings": embed_key("fuzzed")}

    async def ask(session: zenoh.Session, path: str, body: bytes) -> bytes:
        def get() -> bytes:
            (reply,) = list(session.get(keys[path], payload=body, timeout=TIMEOUT_S))
            answer: bytes = reply.result.payload.to_bytes()
            return answer

        return await asyncio.to_thread(get)

    with zenoh.open(config) as session:
        yield lambda path, body: runner.run(ask(session, path, body))
    runner.run(door.__aexit__())


@pytest.fixture(params=["http", "zenoh"])
def ask(request: pytest.FixtureRequest) -> Ask:
    chosen: Ask = request.getfixturevalue(f"over_{request.param}")
    return chosen


def check_subgoals(answer: bytes) -> None:
    """A refusal is right, and so is a reply: but nothing else."""
    try:
        answers = decode_replies(answer)
    except PlannerError as error:
        answers = [error]
    for given_back in answers:
        assert isinstance(given_back, SubgoalReply | InvalidRequest | ProtocolMismatch), repr(given_back)


RGB = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
JPEG: bytes = simplejpeg.encode_jpeg(RGB)
GOOD_FRAMES = [Frame.raw(RGB[:4, :4]), Frame(encoding="jpeg", data=JPEG)]
GOOD_REQUESTS = [SubgoalRequest(request_id="7", goal="chair", frame=f, recent=(f,)) for f in GOOD_FRAMES]
GOOD_BODIES = [encode_requests([request]) for request in GOOD_REQUESTS]

scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=60)
    | st.binary(max_size=60)
    | st.sampled_from(["raw", "jpeg", "png", "subgoal", "plan", 1, 16, JPEG, "chair", 0.5, 3600, 1e308])
)
names = st.text(max_size=8) | st.sampled_from(
    [*SubgoalRequest.model_fields, *Frame.model_fields, "version", "requests", "texts", "embed", "error"]
)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(names, inner, max_size=6),
    max_leaves=12,
)


@st.composite
def almost_good_bodies(draw: st.DrawFn) -> bytes:
    """A good body in which some field, somewhere, holds something else."""
    content: dict[str, Any] = msgpack.unpackb(draw(st.sampled_from(GOOD_BODIES)))
    for _ in range(draw(st.integers(1, 3))):
        place: Any = content
        while isinstance(place, dict | list) and place:
            keys = sorted(place) if isinstance(place, dict) else range(len(place))
            key = draw(st.sampled_from(list(keys)))
            if not (isinstance(place[key], dict | list) and draw(st.booleans())):
                place[key] = draw(values)
                break
            place = place[key]
    for request in content.get("requests") or [] if isinstance(content.get("requests"), list) else []:
        if isinstance(request, dict):
            request["deadline"] = 30.0  # or being late would be what was asked for
    return bytes(msgpack.packb(content))


@st.composite
def damaged_bodies(draw: st.DrawFn) -> bytes:
    """A good body cut, or with some bytes in it replaced, left out or put in."""
    body = draw(st.sampled_from(GOOD_BODIES))
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(body)))
        body = body[:at] + draw(st.binary(max_size=8)) + body[at + draw(st.integers(0, 8)) :]
    return body[: draw(st.integers(0, len(body)))] if draw(st.booleans()) else body


@fuzz
@given(body=almost_good_bodies())
def test_fields_that_hold_something_else(ask: Ask, body: bytes) -> None:
    check_subgoals(ask("subgoals", body))


@fuzz
@given(body=damaged_bodies() | st.binary(max_size=200) | st.binary(min_size=19_990, max_size=20_010))
def test_bytes_that_are_no_body(ask: Ask, body: bytes) -> None:
    check_subgoals(ask("subgoals", body))


@fuzz
@given(body=values.map(lambda v: bytes(msgpack.packb({"version": 1, "embed": {"texts": v}}))) | st.binary(max_size=200))
def test_texts_that_are_no_texts(ask: Ask, body: bytes) -> None:
    with contextlib.suppress(InvalidRequest, ProtocolMismatch):
        decode_embed_reply(ask("embeddings", body))


def test_after_all_that_it_answers(ask: Ask) -> None:
    (answer,) = decode_replies(ask("subgoals", GOOD_BODIES[1]))
    assert isinstance(answer, SubgoalReply)
    assert len(decode_embed_reply(ask("embeddings", encode_embed_request(EmbedRequest(texts=("a",))))).embeddings) == 1
