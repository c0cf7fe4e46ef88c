"""The HTTP door: content types, statuses, limits while streaming, and errors in the contract's form."""

import asyncio
import base64
import json
import re
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any, Self

import httpx
import numpy as np
import pytest
import simplejpeg

from thinknav_models.clip import ClipTextEncoder, shipped_text_encoder
from thinknav_proto import (
    CONTENT_TYPE,
    EmbedRequest,
    Frame,
    InvalidRequest,
    Limits,
    PlannerError,
    PlannerFailed,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
    decode_embed_reply,
    decode_info,
    decode_replies,
    encode_embed_request,
    encode_requests,
)
from thinknav_server import status_page
from thinknav_server.hosts import PlannerThread
from thinknav_server.http import create_app
from thinknav_server.intake import Intake
from thinknav_server.planners import Script, ScriptedPlanner
from thinknav_server.recent import Seen
from thinknav_server.service import PlanningService
from thinknav_server.settings import Settings
from thinknav_server.tokens import Tokens

BINARY = {"Content-Type": CONTENT_TYPE}
LIMITS = Limits(max_frames=4, max_pixels=10_000, max_body_bytes=50_000, max_text_length=50, max_texts=4)
SCRIPT = Script.model_validate({"default": ["turn left toward the {goal}"]})
RGB = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
JPEG = simplejpeg.encode_jpeg(RGB)


class Client:
    """Calls the application without a network; as a context manager, within its lifespan."""

    def __init__(self, failure_rate: float = 0.0, show_frames: bool = False) -> None:
        planner = ScriptedPlanner(SCRIPT, failure_rate=failure_rate)
        settings = Settings(limits=LIMITS, show_frames=show_frames)
        service = PlanningService(PlannerThread(planner, shipped_text_encoder()), settings)
        self._app = create_app(service, Tokens({}), Intake(LIMITS.max_body_bytes, 10**6, body_timeout=0.5))
        self._runner = asyncio.Runner()
        self._lifespan = self._app.router.lifespan_context(self._app)
        transport = httpx.ASGITransport(self._app, raise_app_exceptions=False)
        self._client = httpx.AsyncClient(transport=transport, base_url="http://service")

    def __enter__(self) -> Self:
        self._runner.run(self._lifespan.__aenter__())
        return self

    def __exit__(self, *error: object) -> None:
        self._runner.run(self._lifespan.__aexit__(None, None, None))
        self._runner.close()

    def post(self, path: str, **options: Any) -> httpx.Response:
        return self._runner.run(self._client.post(path, **options))

    def get(self, path: str, **options: Any) -> httpx.Response:
        return self._runner.run(self._client.get(path, **options))


@pytest.fixture
def client() -> Iterator[Client]:
    with Client() as client:
        yield client


def body(*goals: str) -> bytes:
    return encode_requests([SubgoalRequest(request_id=goal, goal=goal, frame=Frame.raw(RGB)) for goal in goals])


def test_binary_requests_get_binary_replies(client: Client) -> None:
    response = client.post("/v1/subgoals", content=body("chair", "bed"), headers=BINARY)
    assert response.status_code == 200
    assert response.headers["content-type"] == CONTENT_TYPE
    subgoals = [reply.subgoal for reply in decode_replies(response.content) if isinstance(reply, SubgoalReply)]
    assert subgoals == ["turn left toward the chair", "turn left toward the bed"]


def test_people_post_forms_and_read_json(client: Client) -> None:
    files = [("frame", ("a.jpg", JPEG)), ("frame", ("b.txt", b"no picture"))]
    response = client.post("/v1/subgoals", data={"goal": "sofa", "temperature": "0.5"}, files=files)
    assert response.status_code == 200
    first, second = response.json()["replies"]
    assert first["reply"]["subgoal"] == "turn left toward the sofa"
    assert len(first["reply"]["embedding"]) == 512
    assert first["reply"]["planner"].startswith("scripted@")
    assert set(first["reply"]["timings"]) == {"queued", "planned", "embedded"}
    assert second["error"]["code"] == "invalid_request"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "needs the field 'goal'"),
        ({"goal": "sofa", "temperature": "hot"}, "'temperature' must be a number"),
        ({"goal": "sofa", "colour": "red"}, "'colour' is not understood"),
        ({"goal": "sofa", "mode": "dream"}, "mode"),
        ({"goal": "sofa", "deadline": "nan"}, "deadline"),
    ],
)
def test_a_wrong_form_is_told_what_is_wrong(client: Client, data: dict[str, str], message: str) -> None:
    response = client.post("/v1/subgoals", data=data, files={"frame": ("a.jpg", JPEG)})
    assert response.status_code == 400
    content = response.json()
    error = content["error"] if "error" in content else content["replies"][0]["error"]
    assert error["code"] == "invalid_request"
    assert message in error["message"]


def test_a_form_without_a_frame_or_with_too_many_is_refused(client: Client) -> None:
    assert "-F frame=" in client.post("/v1/subgoals", files={"goal": (None, "sofa")}).json()["error"]["message"]
    files = [("frame", (f"{index}.jpg", JPEG)) for index in range(5)]
    response = client.post("/v1/subgoals", data={"goal": "sofa"}, files=files)
    assert response.status_code == 400
    assert "Too many files" in response.json()["error"]["message"]


def test_one_bad_item_does_not_change_the_status_and_all_bad_ones_do(client: Client) -> None:
    long = "c" * 51
    mixed = client.post("/v1/subgoals", content=body("chair", long), headers=BINARY)
    assert mixed.status_code == 200
    assert [type(answer) for answer in decode_replies(mixed.content)] == [SubgoalReply, InvalidRequest]
    assert client.post("/v1/subgoals", content=body(long), headers=BINARY).status_code == 400


def test_a_failing_planner_is_a_bad_gateway() -> None:
    with Client(failure_rate=1.0) as client:
        response = client.post("/v1/subgoals", content=body("chair"), headers=BINARY)
    assert response.status_code == 502
    assert isinstance(decode_replies(response.content)[0], PlannerFailed)


@pytest.mark.parametrize(
    ("content", "error"),
    [
        (b"", InvalidRequest),
        (b"\xff\x00", InvalidRequest),
        (body("chair")[:-1], InvalidRequest),
        (body("chair").replace(b"\xa7version\x01", b"\xa7version\x02"), ProtocolMismatch),
    ],
)
def test_a_body_that_cannot_be_read_gets_a_binary_error(
    client: Client, content: bytes, error: type[PlannerError]
) -> None:
    response = client.post("/v1/subgoals", content=content, headers=BINARY)
    assert response.status_code == error.http_status
    assert response.headers["content-type"] == CONTENT_TYPE
    with pytest.raises(PlannerError) as raised:
        decode_replies(response.content)
    assert type(raised.value) is error


FORM_START = b'--x\r\nContent-Disposition: form-data; name="frame"; filename="a.jpg"\r\n\r\n'


@pytest.mark.parametrize("charset", ["punycode", "undefined", "none"])
def test_a_form_in_an_encoding_that_it_is_not_in_is_refused(client: Client, charset: str) -> None:
    content = (
        b'--x\r\nContent-Disposition: form-data; name="goal"\r\n\r\nch\xffair\r\n'
        + FORM_START
        + JPEG
        + b"\r\n--x--\r\n"
    )
    kind = f"multipart/form-data; boundary=x; charset={charset}"
    response = client.post("/v1/subgoals", content=content, headers={"Content-Type": kind})
    assert response.status_code == (200 if charset == "none" else 400), response.text


@pytest.mark.parametrize("kind", [CONTENT_TYPE, "multipart/form-data; boundary=x"])
def test_a_body_that_is_too_long_is_refused_while_it_arrives(client: Client, kind: str) -> None:
    sent = 0

    async def chunks() -> AsyncIterator[bytes]:
        nonlocal sent
        yield FORM_START
        for _ in range(1000):
            sent += 1000
            yield bytes(1000)

    for content in (chunks(), FORM_START + bytes(100_000)):
        response = client.post("/v1/subgoals", content=content, headers={"Content-Type": kind})
        assert response.status_code == 400
        assert b"longer than the limit of 50000 bytes" in response.content
    assert sent <= 102_000  # what is read after the refusal is thrown away


def test_too_many_pixels_are_refused_before_decoding(client: Client) -> None:
    large = simplejpeg.encode_jpeg(np.zeros((101, 100, 3), np.uint8))
    response = client.post("/v1/subgoals", data={"goal": "sofa"}, files={"frame": ("a.jpg", large)})
    assert response.json()["replies"][0]["error"]["message"].startswith("the frame has 100 x 101 pixels")


def test_embeddings_in_both_languages(client: Client) -> None:
    expected = shipped_text_encoder().encode(["find a chair"])
    asked = encode_embed_request(EmbedRequest(texts=("find a chair",)))
    reply = decode_embed_reply(client.post("/v1/embeddings", content=asked, headers=BINARY).content)
    np.testing.assert_array_equal(reply.embeddings, expected)
    told = client.post("/v1/embeddings", json={"texts": ["find a chair"]}).json()["embedded"]
    np.testing.assert_array_equal(np.array(told["embeddings"], np.float32), expected)
    assert told["embedding_space"] == reply.embedding_space


@pytest.mark.parametrize("text", ['{"texts": []}', '{"texts": [3]}', "{", '{"texts": ["a"], "more": 1}'])
def test_wrong_json_is_told_what_is_wrong(client: Client, text: str) -> None:
    response = client.post("/v1/embeddings", content=text, headers={"Content-Type": "application/json"})
    assert response.status_code == 400
    assert response.json()["error"]["code"] == "invalid_request"


def test_the_planner_is_told_in_both_languages(client: Client) -> None:
    told = client.get("/v1/planner").json()["info"]
    info = decode_info(client.get("/v1/planner", headers={"Accept": CONTENT_TYPE}).content)
    assert json.loads(info.model_dump_json()) == told
    assert info.planner == "scripted"
    assert info.limits == LIMITS


@pytest.mark.parametrize("path", ["/v1/subgoals", "/v1/embeddings"])
def test_another_content_type_is_refused_with_those_that_are_taken(client: Client, path: str) -> None:
    response = client.post(path, content=b"x", headers={"Content-Type": "text/plain"})
    assert response.status_code == 400
    assert CONTENT_TYPE in response.json()["error"]["message"]


def test_unknown_paths_and_methods_keep_the_form_of_errors(client: Client) -> None:
    assert client.get("/v2").json()["error"]["message"] == "GET /v2: Not Found"
    response = client.get("/v1/subgoals")
    assert (response.status_code, response.headers["allow"]) == (405, "POST")
    with pytest.raises(InvalidRequest):
        decode_info(client.get("/v2", headers={"Accept": CONTENT_TYPE}).content)


def test_health_and_readiness() -> None:
    client = Client()
    assert client.get("/healthz").status_code == 200
    assert client.get("/readyz").status_code == 503
    assert client.get("/readyz").json()["error"]["code"] == "unavailable"
    with client:
        assert client.get("/readyz").json() == {"status": "ready"}


def test_a_bug_is_a_500_in_the_form_of_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    def bug(*_: object) -> object:
        raise RuntimeError("a bug")

    monkeypatch.setattr(ClipTextEncoder, "encode", bug)
    with Client() as client:
        response = client.post("/v1/embeddings", json={"texts": ["a"]})
    assert response.status_code == 500
    assert response.json()["error"]["code"] == "planner_failed"
    assert "a bug" not in response.text


def test_metrics_count_what_was_answered(client: Client) -> None:
    client.post("/v1/subgoals", content=body("chair", "bed", "c" * 51), headers=BINARY)
    client.post("/v1/subgoals", content=body("chair"), headers=BINARY)
    response = client.get("/metrics")
    assert response.headers["content-type"].startswith("text/plain; version=0.0.4")
    told = dict(line.rsplit(" ", 1) for line in response.text.splitlines() if not line.startswith("#"))
    assert told['thinknav_requests_total{outcome="ok"}'] == "3.0"
    assert told['thinknav_requests_total{outcome="invalid_request"}'] == "1.0"
    assert told['thinknav_saved_total{how="cache"}'] == "1.0"
    assert told["thinknav_batch_size_sum"] == "2.0"
    assert told["thinknav_cache_entries"] == "2.0"
    assert told["thinknav_ready"] == "1.0"
    assert told["thinknav_in_flight"] == "0.0"
    assert told['thinknav_request_seconds_count{stage="planned"}'] == "3.0"


def test_every_metric_is_documented(client: Client) -> None:
    told = set(re.findall(r"^# TYPE (\w+?)(?:_created)? ", client.get("/metrics").text, re.MULTILINE))
    page = (Path(__file__).parents[2] / "docs" / "metrics.md").read_text()
    documented = set(re.findall(r"^\| `(thinknav_\w+)", page, re.MULTILINE))
    assert told == documented


def test_a_request_is_logged_with_its_client_and_trace(client: Client, caplog: pytest.LogCaptureFixture) -> None:
    trace_id = "4bf92f3577b34da6a3ce929d0e0e4736"
    with caplog.at_level("INFO", logger="thinknav_server.requests"):
        headers = BINARY | {"traceparent": f"00-{trace_id}-00f067aa0ba902b7-01"}
        client.post("/v1/subgoals", content=body("chair", "bed"), headers=headers)
    (record,) = (record for record in caplog.records if record.name == "thinknav_server.requests")
    fields = record.__dict__["fields"]
    assert (fields["door"], fields["client"], fields["trace_id"]) == ("http", "127.0.0.1", trace_id)
    assert (fields["requests"], fields["answered"]) == (2, 2)


def test_the_status_page_tells_people_how_it_goes(client: Client) -> None:
    assert "Nobody has asked yet" in client.get("/").text
    client.post("/v1/subgoals", content=body("chair", "bed"), headers=BINARY)
    response = client.get("/")
    assert response.headers["content-type"] == "text/html; charset=utf-8"
    page = response.text
    assert '<span class="state ready">ready</span>' in page
    assert "Latencies of the last 2 answers" in page
    assert '<td class="n">2</td><td class="n">1</td>' in page  # one batch of two
    assert "<img" not in page
    assert "--show-frames" in page


def test_a_frame_that_no_picture_can_hold_does_not_break_the_page() -> None:
    figure = status_page._figure(Seen(Frame.raw(np.zeros((1, 70_000, 3), np.uint8)), "chair", "go on", "robots"))
    assert "Too long to be shown" in figure
    assert "go on" in figure


def test_frames_are_shown_only_where_that_is_asked_for() -> None:
    with Client(show_frames=True) as client:
        assert "None yet" in client.get("/").text
        client.post("/v1/subgoals", content=body("<b>bed</b>"), headers=BINARY)
        client.post("/v1/subgoals", data={"goal": "sofa"}, files={"frame": ("a.jpg", JPEG)})
        page = client.get("/").text
    pictures = re.findall(r'src="data:image/jpeg;base64,([^"]+)"', page)
    assert base64.b64decode(pictures[0]) == JPEG  # the newest first
    assert simplejpeg.decode_jpeg(base64.b64decode(pictures[1])).shape == (16, 16, 3)
    assert "turn left toward the &lt;b&gt;bed&lt;/b&gt;" in page
    assert "<b>bed" not in page
