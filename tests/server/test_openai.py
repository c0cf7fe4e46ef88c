"""The `openai` planner against a server that answers as it is told to."""

import asyncio
import base64
import json
import threading
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
import simplejpeg
from aiohttp import web

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import (
    DeadlineExceeded,
    Frame,
    InvalidRequest,
    Overloaded,
    PlannerError,
    PlannerFailed,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
)
from thinknav_server.caller import Caller, Trace
from thinknav_server.hosts import PlannerInLoop
from thinknav_server.planners import Plan, PlanItem, View
from thinknav_server.planners import upstream as upstream_module
from thinknav_server.planners.openai import OpenAIPlanner
from thinknav_server.planners.options import OpenAIOptions
from thinknav_server.service import PlanningService
from thinknav_server.settings import Settings

T = TypeVar("T")
FRAME = np.full((32, 48, 3), 90, np.uint8)
ITEM = PlanItem(FRAME, "chair")


class MockServer:
    """Lists `models`, and answers each call with the next of `script`: a status or a text; the last one stays."""

    def __init__(self) -> None:
        self.models = [{"id": "qwen", "created": 1, "root": "/models/qwen"}]
        self.unlisted: set[str] = set()
        self.script: list[int | str] = ["turn left"]
        self.guided = True
        self.odd_page: bytes | None = None  # in place of the list of models
        self.bodies: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self.at_once = 0
        self.most_at_once = 0
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._runner = self._call(self._start(0))
        self.port: int = self._runner.addresses[0][1]

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/v1"

    def stop_listening(self) -> None:
        self._call(self._runner.cleanup())

    def listen_again(self) -> None:
        self._runner = self._call(self._start(self.port))

    def close(self) -> None:
        self.stop_listening()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _call(self, work: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(30)

    async def _start(self, port: int) -> web.AppRunner:
        app = web.Application()
        app.router.add_get("/v1/models", self._models)
        app.router.add_post("/v1/chat/completions", self._complete)
        runner = web.AppRunner(app, shutdown_timeout=0.01)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", port).start()
        return runner

    async def _models(self, request: web.Request) -> web.Response:
        if self.odd_page is not None:
            return web.Response(status=502, body=self.odd_page, content_type="text/html", charset="utf-8")
        return web.json_response({"data": self.models})

    async def _complete(self, request: web.Request) -> web.Response:
        body = await request.json()
        self.bodies.append(body)
        self.headers.append(dict(request.headers))
        if body["model"] not in self.unlisted | {model["id"] for model in self.models}:
            return web.json_response({"error": "model is not known"}, status=404)
        if "response_format" in body and not self.guided:
            return web.json_response({"error": "response_format is not known"}, status=400)
        self.at_once += 1
        self.most_at_once = max(self.most_at_once, self.at_once)
        await asyncio.sleep(0.02)
        self.at_once -= 1
        answer = self.script.pop(0) if len(self.script) > 1 else self.script[0]
        if answer == "hang":
            await asyncio.sleep(60)
        if isinstance(answer, int):
            return web.Response(status=answer, text="as told", headers={"Retry-After": "0"})
        return web.json_response({"choices": [{"message": {"content": answer}}]})


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[MockServer]:
    monkeypatch.setattr(upstream_module, "_FIRST_PAUSE_S", 0.001)
    server = MockServer()
    yield server
    server.close()


def planner_of(server: MockServer, **options: Any) -> OpenAIPlanner:
    return OpenAIPlanner(OpenAIOptions(url=server.url, **options))


def within(planner: OpenAIPlanner, work: Callable[[], Coroutine[Any, Any, T]]) -> T:
    async def opened() -> T:
        async with asyncio.timeout(30), planner:
            return await work()

    return asyncio.run(opened())


def ask(planner: OpenAIPlanner, item: PlanItem = ITEM, trace: Trace | None = None) -> Plan | PlannerError:
    return within(planner, lambda: planner.plan(item, trace))


def test_frames_views_and_words_are_sent(server: MockServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KEY", "secret")
    item = PlanItem(FRAME, "chair", recent=(View(FRAME[:16], 0.5),), temperature=0.7)
    trace = Trace("4bf92f3577b34da6a3ce929d0e0e4736")
    planner = planner_of(server, guided=False, key_env="KEY", max_new_tokens=9)
    assert ask(planner, item, trace) == Plan(("turn left",))
    (body,), (headers,) = server.bodies, server.headers
    assert (body["model"], body["temperature"], body["max_tokens"]) == ("qwen", 0.7, 9)
    assert body["messages"][0]["role"] == "system"
    content = body["messages"][1]["content"]
    assert [part["type"] for part in content] == ["text", "image_url", "text", "image_url", "text"]
    assert content[0]["text"] == "An earlier view, 30 degrees to the left:"
    assert "chair" in content[4]["text"]
    sizes = []
    for index in (1, 3):
        kind, _, data = content[index]["image_url"]["url"].partition(",")
        assert kind == "data:image/jpeg;base64"
        sizes.append(simplejpeg.decode_jpeg(base64.b64decode(data)).shape)
    assert sizes == [(16, 48, 3), (32, 48, 3)]
    assert headers["Authorization"] == "Bearer secret"
    assert headers["traceparent"].split("-")[1] == trace.trace_id


def test_guided_answers_are_unwrapped(server: MockServer) -> None:
    server.script = [json.dumps({"instructions": ["turn left", "move forward"]})]
    assert ask(planner_of(server), PlanItem(FRAME, "bed", mode="plan")) == Plan(("turn left", "move forward"))
    schema = server.bodies[0]["response_format"]
    assert schema["type"] == "json_schema"
    assert schema["json_schema"]["schema"]["required"] == ["instructions"]


def test_a_guided_answer_that_is_cut_off_keeps_its_words(server: MockServer) -> None:
    server.script = ['{"instructions": ["turn left", "move forward to the d']
    answer = ask(planner_of(server), PlanItem(FRAME, "bed", mode="plan"))
    assert answer == Plan(("turn left", "move forward to the d"))


@pytest.mark.parametrize(
    "text",
    [
        '{ "instructions":   \n\n\n',
        '{"instructions": [',
        '{\n  "instructions": [\n    "',
        '{"instructions": null}',
        '{"instructions": [null]}',
        '{"instructions": {"a": 1}}',
        '{"answer": "turn left"}',
    ],
)
def test_json_without_an_instruction_is_not_followed(server: MockServer, text: str) -> None:
    server.script = [text]
    assert isinstance(ask(planner_of(server)), PlannerFailed)


def test_what_is_escaped_in_json_is_not_when_it_is_cut_off(server: MockServer) -> None:
    server.script = ['{"instructions": ["go to the \\"blue\\" door']
    assert ask(planner_of(server)) == Plan(('go to the "blue" door',))


def test_a_text_that_no_reply_can_carry_fails_alone(server: MockServer) -> None:
    """Half of a pair of surrogates, which JSON lets through: the others of the body have their answers."""
    server.script = ["turn left", "turn \ud83d", "turn right"]
    service = PlanningService(PlannerInLoop(planner_of(server), shipped_text_encoder(), 1), Settings())

    async def body() -> list[SubgoalReply | PlannerError]:
        async with service:
            requests = [SubgoalRequest(request_id=goal, goal=goal, frame=Frame.raw(FRAME)) for goal in "abc"]
            return await service.answer_each(requests)

    first, second, third = asyncio.run(body())
    assert isinstance(first, SubgoalReply)
    assert isinstance(second, PlannerFailed)
    assert isinstance(third, SubgoalReply)


def test_a_server_without_guided_output_is_asked_without(server: MockServer) -> None:
    server.guided = False
    planner = planner_of(server)

    async def twice() -> list[Plan | PlannerError]:
        return [await planner.plan(ITEM), await planner.plan(ITEM)]

    assert within(planner, twice) == 2 * [Plan(("turn left",))]
    assert ["response_format" in body for body in server.bodies] == [True, False, False]


def test_a_busy_server_is_asked_again(server: MockServer) -> None:
    server.script = [503, 429, "turn right"]
    assert ask(planner_of(server)) == Plan(("turn right",))
    assert len(server.bodies) == 3


def test_one_that_stays_busy_is_overloaded(server: MockServer) -> None:
    server.script = [429]
    with pytest.raises(Overloaded, match="is busy"):
        ask(planner_of(server))
    assert len(server.bodies) == upstream_module._ATTEMPTS


@pytest.mark.parametrize(("status", "reason"), [(500, "refused with 500"), (401, "is the key right"), (404, "404")])
def test_what_failed_is_not_asked_again(server: MockServer, status: int, reason: str) -> None:
    server.script = [status]
    with pytest.raises(PlannerFailed, match=reason):
        ask(planner_of(server, guided=False))
    assert len(server.bodies) == 1


def test_what_takes_too_long_is_not_asked_again(server: MockServer) -> None:
    server.script = ["hang"]
    with pytest.raises(PlannerFailed, match=r"did not answer within 0\.2 s"):
        ask(planner_of(server, timeout=0.2))
    assert len(server.bodies) == 1


@pytest.mark.parametrize("text", ["", "{}", '{"instructions": []}'])
def test_an_empty_answer_is_a_failure(server: MockServer, text: str) -> None:
    server.script = [text]
    answer = ask(planner_of(server))
    assert isinstance(answer, PlannerFailed)


def test_it_says_who_is_asked(server: MockServer) -> None:
    identity = planner_of(server).identity
    assert identity.name == "openai/qwen"
    server.models[0]["created"] = 2  # when a server started says nothing of its weights
    assert planner_of(server).identity == identity
    server.models[0]["root"] = "/models/qwen-2"
    assert planner_of(server).identity != identity


def test_the_wrong_model_or_server_is_told_at_once(server: MockServer) -> None:
    with pytest.raises(ValueError, match=r"does not serve 'gpt' but qwen; see --upstream-model .*refused with 404"):
        planner_of(server, model="gpt")
    server.models.append({"id": "other"})
    with pytest.raises(ValueError, match=r"serves qwen, other; choose one by --upstream-model"):
        planner_of(server)
    assert planner_of(server, model="other").identity.name == "openai/other"
    with pytest.raises(ValueError, match=r"refused with 404.*up to and with /v1"):
        OpenAIPlanner(OpenAIOptions(url=server.url.removesuffix("/v1")))
    server.stop_listening()
    with pytest.raises(ValueError, match="no model server at"):
        planner_of(server)
    server.listen_again()


def test_a_list_of_models_that_is_none_is_told(server: MockServer) -> None:
    server.models = None  # type: ignore[assignment]
    with pytest.raises(ValueError, match="does not list its models"):
        planner_of(server)


def test_a_frame_longer_than_jpeg_knows_is_refused(server: MockServer) -> None:
    with pytest.raises(InvalidRequest, match="cannot be sent as JPEG"):
        ask(planner_of(server), PlanItem(np.zeros((1, 70_000, 3), np.uint8), "chair"))


def test_a_model_that_is_served_but_not_listed_is_taken(server: MockServer) -> None:
    server.models = []
    server.unlisted = {"/models/qwen"}
    planner = planner_of(server, model="/models/qwen")
    assert planner.identity.name == "openai/qwen"
    assert ask(planner) == Plan(("turn left",))
    assert [body["model"] for body in server.bodies] == ["/models/qwen"] * 2


def request(name: str, **fields: Any) -> SubgoalRequest:
    return SubgoalRequest(request_id=name, goal=f"chair {name}", frame=Frame.raw(FRAME), **fields)


def test_a_service_over_it_asks_many_at_once_but_not_more_than_it_may(server: MockServer) -> None:
    planner = planner_of(server, concurrency=4)
    service = PlanningService(PlannerInLoop(planner, shipped_text_encoder(), 4), Settings())

    async def test() -> list[SubgoalReply | PlannerError]:
        async with service:
            broken = SubgoalRequest(request_id="b", goal="bed", frame=Frame(encoding="jpeg", data=b"\xff\xd8\xff"))
            answers = await service.answer_each([request(str(index)) for index in range(20)], Caller("a"))
            return [*answers, *await service.answer_each([broken])]

    *answers, broken = asyncio.run(test())
    assert isinstance(broken, InvalidRequest)
    assert {answer.subgoal for answer in answers if isinstance(answer, SubgoalReply)} == {"turn left"}
    assert len(answers) == 20
    assert server.most_at_once == 4


@pytest.mark.parametrize("odd_page", [None, b"d\xe9faillante"])
def test_a_service_whose_server_goes_away_is_not_ready_until_it_is_back(
    server: MockServer, monkeypatch: pytest.MonkeyPatch, odd_page: bytes | None
) -> None:
    monkeypatch.setattr("thinknav_server.planners.openai._LOOK_AGAIN_S", 0.01)
    planner = planner_of(server)
    service = PlanningService(PlannerInLoop(planner, shipped_text_encoder(), 4), Settings())

    async def test() -> None:
        async with asyncio.timeout(30), service:
            assert service.ready
            await asyncio.to_thread(server.stop_listening)
            (gone,) = await service.answer_each([request("1")])
            assert isinstance(gone, Unavailable)
            assert not service.ready
            server.odd_page = odd_page
            await asyncio.to_thread(server.listen_again)
            if odd_page is not None:
                await asyncio.sleep(0.1)  # in which it is looked for some ten times
                assert not service.ready
                server.odd_page = None
            while not service.ready:
                await asyncio.sleep(0.01)
            (answer,) = await service.answer_each([request("2")])
            assert isinstance(answer, SubgoalReply)

    asyncio.run(test())


def test_a_call_ends_with_its_deadline(server: MockServer) -> None:
    server.script = ["hang"]
    planner = planner_of(server)
    service = PlanningService(PlannerInLoop(planner, shipped_text_encoder(), 1), Settings(cache_size=0))

    async def test() -> None:
        async with asyncio.timeout(30), service:
            (late,) = await service.answer_each([request("1", deadline=0.1)])
            assert isinstance(late, DeadlineExceeded)
            server.script = ["turn left"]
            (answer,) = await service.answer_each([request("2")])
            assert isinstance(answer, SubgoalReply)

    asyncio.run(test())


def test_a_prompt_of_ones_own_is_used(server: MockServer, tmp_path: Path) -> None:
    path = tmp_path / "prompt.yaml"
    path.write_text("{system: be brief, view: v, now: n, subgoal: 'seek {goal}', plan: 'plan {goal}'}")
    ask(planner_of(server, prompt=path))
    assert server.bodies[0]["messages"][1]["content"][-1]["text"] == "seek chair"
