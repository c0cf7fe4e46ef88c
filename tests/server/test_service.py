"""The service without HTTP: admission, batching, planning and embedding, item by item."""

import asyncio
import threading
from collections.abc import Coroutine, Sequence
from typing import Any, TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_models import EmbeddingSpace
from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import (
    EmbedRequest,
    Frame,
    InvalidRequest,
    Limits,
    Overloaded,
    PlannerError,
    PlannerFailed,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
)
from thinknav_server.hosts import PlannerThread
from thinknav_server.planners import Plan, PlanItem, PlannerIdentity
from thinknav_server.service import PlanningService
from thinknav_server.settings import Settings

T = TypeVar("T")

LIMITS = Limits(max_frames=6, max_pixels=64, max_body_bytes=10_000, max_text_length=20, max_texts=3)
SETTINGS = Settings(max_batch=4, queue_size=8, limits=LIMITS)


class Recording:
    """Says where it was asked to go, and keeps what it was asked; chokes on the goal "poison"."""

    identity = PlannerIdentity("recording", "r1", "p1")

    def __init__(self) -> None:
        self.batches: list[list[PlanItem]] = []

    def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
        if any(item.goal == "poison" for item in items):
            raise RuntimeError("choked")
        self.batches.append(list(items))
        return [Plan((f"go to the {item.goal}", "stop"), confidence=0.5) for item in items]


class GatedEncoder:
    """The shipped one, which waits until its gate is opened."""

    space, dimension = shipped_text_encoder().space, 512

    def __init__(self) -> None:
        self.gate = threading.Event()

    def encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
        assert self.gate.wait(10)
        return shipped_text_encoder().encode(texts)


def request(name: str, goal: str = "chair", size: int = 4, **fields: Any) -> SubgoalRequest:
    frame = Frame.raw(np.full((size, size, 3), 7, np.uint8))
    return SubgoalRequest(request_id=name, goal=goal, frame=frame, **fields)


def within(service: PlanningService, work: Coroutine[Any, Any, T]) -> T:
    async def opened() -> T:
        async with asyncio.timeout(30), service:
            return await work

    return asyncio.run(opened())


def ask(*requests: SubgoalRequest | PlannerError) -> list[SubgoalReply | PlannerError]:
    service = PlanningService(PlannerThread(Recording(), shipped_text_encoder()), SETTINGS)
    return within(service, service.answer_each(requests))


def test_a_reply_says_everything() -> None:
    (reply,) = ask(request("7"))
    assert isinstance(reply, SubgoalReply)
    assert (reply.request_id, reply.subgoal, reply.instructions) == ("7", "go to the chair", ())
    assert (reply.confidence, reply.planner) == (0.5, "recording@r1")
    np.testing.assert_array_equal(reply.embedding, shipped_text_encoder().encode(["go to the chair"])[0])
    assert reply.embedding_space == str(shipped_text_encoder().space)


def test_a_plan_keeps_all_its_instructions() -> None:
    (reply,) = ask(request("7", mode="plan"))
    assert isinstance(reply, SubgoalReply)
    assert reply.subgoal == "go to the chair"
    assert reply.instructions == ("go to the chair", "stop")


def test_the_planner_sees_the_pixels_the_views_and_the_temperature() -> None:
    planner = Recording()
    service = PlanningService(PlannerThread(planner, shipped_text_encoder()), SETTINGS)
    old = Frame.raw(np.full((2, 3, 3), 9, np.uint8), heading=0.5)
    within(service, service.answer_each([request("7", recent=(old,), temperature=0.8)]))
    ((item,),) = planner.batches
    assert (item.goal, item.mode, item.temperature) == ("chair", "subgoal", 0.8)
    assert item.frame.shape == (4, 4, 3)
    assert item.frame.max() == 7
    assert (item.recent[0].heading, item.recent[0].frame.shape) == (0.5, (2, 3, 3))


def test_requests_of_one_body_share_batches() -> None:
    planner = Recording()
    service = PlanningService(PlannerThread(planner, shipped_text_encoder()), SETTINGS)
    within(service, service.answer_each([request(str(index), goal=f"chair {index}") for index in range(6)]))
    assert [len(batch) for batch in planner.batches] == [4, 2]


def test_every_bad_item_fails_alone() -> None:
    broken = SubgoalRequest(request_id="b", goal="chair", frame=Frame(encoding="jpeg", data=b"\xff\xd8\xff no picture"))
    answers = ask(
        request("0"),
        broken,
        request("2", goal="poison"),
        request("3", size=9),
        request("4", goal="c" * 21),
        InvalidRequest("undecodable from the start"),
        request("6", goal="bed"),
    )
    assert [type(answer) for answer in answers] == [
        SubgoalReply,
        InvalidRequest,
        PlannerFailed,
        InvalidRequest,
        InvalidRequest,
        InvalidRequest,
        SubgoalReply,
    ]
    messages = [answer.message for answer in answers if isinstance(answer, PlannerError)]
    assert "JPEG" in messages[0]
    assert "choked" in messages[1]
    assert messages[2] == "the frame has 9 x 9 pixels, the limit is 64 in all"
    assert messages[3] == "the goal has 21 characters, the limit is 20"
    assert isinstance(answers[-1], SubgoalReply)
    assert answers[-1].subgoal == "go to the bed"


def test_a_picture_that_breaks_in_the_middle_fails_alone() -> None:
    header = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x04\x00\x00\x00\x04\x08\x02\x00\x00\x00"
    broken = SubgoalRequest(request_id="b", goal="chair", frame=Frame(encoding="png", data=header))
    answers = ask(broken, request("1"))
    assert [type(answer) for answer in answers] == [InvalidRequest, SubgoalReply]


def test_too_many_frames_refuse_the_whole_body() -> None:
    old = Frame.raw(np.zeros((1, 1, 3), np.uint8))
    with pytest.raises(InvalidRequest, match="7 frames, the limit is 6"):
        ask(*(request(str(index)) for index in range(5)), request("5", recent=(old,)))


def test_a_service_that_is_not_open_is_unavailable() -> None:
    service = PlanningService(PlannerThread(Recording(), shipped_text_encoder()), SETTINGS)
    assert not service.ready
    (answer,) = asyncio.run(service.answer_each([request("7")]))
    assert isinstance(answer, Unavailable)


def test_texts_are_embedded_within_limits() -> None:
    service = PlanningService(PlannerThread(Recording(), shipped_text_encoder()), SETTINGS)
    reply = within(service, service.embed(EmbedRequest(texts=("find a chair", "find a bed"))))
    np.testing.assert_array_equal(reply.embeddings, shipped_text_encoder().encode(["find a chair", "find a bed"]))
    assert reply.embedding_space == str(shipped_text_encoder().space) == service.info.embedding_space
    with pytest.raises(InvalidRequest, match="4 texts, the limit is 3"):
        within(service, service.embed(EmbedRequest(texts=("a", "b", "c", "d"))))
    with pytest.raises(InvalidRequest, match="text 1 has 21 characters"):
        within(service, service.embed(EmbedRequest(texts=("a", "b" * 21))))


def test_more_texts_than_may_wait_are_refused() -> None:
    encoder = GatedEncoder()

    async def test(service: PlanningService) -> None:
        one = EmbedRequest(texts=("find a chair",))
        waiting = [asyncio.create_task(service.embed(one)) for _ in range(SETTINGS.queue_size)]
        await asyncio.sleep(0)
        with pytest.raises(Overloaded, match="8 requests wait for embeddings"):
            await service.embed(one)
        encoder.gate.set()
        await asyncio.gather(*waiting)
        await service.embed(one)

    service = PlanningService(PlannerThread(Recording(), encoder), SETTINGS)
    within(service, test(service))


@pytest.mark.parametrize("others", [[], [PlannerFailed("arrived as an error")]])
def test_draining_waits_for_embeddings_too(others: list[PlannerError]) -> None:
    """Whether or not others are answered meanwhile."""
    encoder = GatedEncoder()

    async def test(service: PlanningService) -> None:
        asked = asyncio.create_task(service.embed(EmbedRequest(texts=("find a chair",))))
        await asyncio.sleep(0)
        await service.answer_each(others)
        drained = asyncio.create_task(service.drain(10))
        await asyncio.sleep(0.05)
        assert not drained.done()
        encoder.gate.set()
        await drained
        assert asked.done()

    service = PlanningService(PlannerThread(Recording(), encoder), SETTINGS)
    within(service, test(service))


def test_the_service_says_who_it_is() -> None:
    info = PlanningService(PlannerThread(Recording(), shipped_text_encoder()), SETTINGS).info
    assert (info.planner, info.revision, info.prompt_hash) == ("recording", "r1", "p1")
    assert info.limits == LIMITS


def test_an_encoder_of_another_dimension_is_refused() -> None:
    class Short:
        dimension = 64
        space = EmbeddingSpace("short", "1")

        def encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
            return np.full((len(texts), 64), 1 / 8, np.float32)

    with pytest.raises(ValueError, match=r"short@1 gives embeddings of 64 values, the protocol carries 512"):
        PlanningService(PlannerThread(Recording(), Short()), SETTINGS)
