"""The client over a mock transport: item by item, nothing raised, counts that add up, bodies within limits."""

import threading
from collections.abc import Sequence

import numpy as np
import pytest

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import EmbedReply, EmbedRequest
from thinknav_trainer.planner import (
    DeadlineExceeded,
    Frame,
    InvalidRequest,
    MockTransport,
    Overloaded,
    PlannerClient,
    PlannerError,
    PlannerFailed,
    PlannerInfo,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
    encode_frame,
    mock_info,
    reply_to,
)

RGB = np.zeros((4, 4, 3), np.uint8)


def request(name: str, goal: str = "chair", deadline: float = 30.0, recent: int = 0) -> SubgoalRequest:
    frame = Frame.raw(RGB)
    return SubgoalRequest(request_id=name, goal=goal, frame=frame, deadline=deadline, recent=(frame,) * recent)


class Recording(MockTransport):
    """Keeps the bodies that it is asked."""

    def __init__(self, **limits: int) -> None:
        info = mock_info().model_copy(update={"limits": mock_info().limits.model_copy(update=limits)})
        super().__init__(lambda request: "turn left", info=info)
        self.bodies: list[list[str]] = []
        self.texts: list[int] = []
        self.closed = False

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
        self.bodies.append([request.request_id for request in requests])
        return super().ask(requests)

    def embed(self, request: EmbedRequest) -> EmbedReply:
        self.texts.append(len(request.texts))
        return super().embed(request)

    def close(self) -> None:
        self.closed = True


def test_a_handler_may_say_a_subgoal_give_a_reply_or_fail() -> None:
    def handler(asked: SubgoalRequest) -> SubgoalReply | PlannerError | str:
        match asked.goal:
            case "chair":
                return "turn left toward the chair"
            case "bed":
                return reply_to(asked, "stop")
            case "sofa":
                return Overloaded("full", 3.0)
            case _:
                raise PlannerFailed("broken")

    client = PlannerClient(MockTransport(handler))
    answers = client.ask([request(goal, goal) for goal in ("chair", "bed", "sofa", "plant")])
    assert [type(answer) for answer in answers] == [SubgoalReply, SubgoalReply, Overloaded, PlannerFailed]
    first = answers[0]
    assert isinstance(first, SubgoalReply)
    assert (first.request_id, first.subgoal) == ("chair", "turn left toward the chair")
    np.testing.assert_array_equal(first.embedding, shipped_text_encoder().encode([first.subgoal])[0])
    counts = client.counts
    assert (counts.asked, counts.answered, counts.failed) == (4, 2, 2)


def test_what_befalls_the_transport_befalls_every_item() -> None:
    class Broken(MockTransport):
        def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
            raise Unavailable("the cable is out")

    client = PlannerClient(Broken(lambda _: "never said"))
    answers = client.ask([request("0"), request("1")])
    assert [str(answer) for answer in answers] == ["the cable is out"] * 2
    assert (client.counts.asked, client.counts.answered, client.counts.failed) == (2, 0, 2)


def test_a_defect_of_the_handler_is_not_hidden() -> None:
    def handler(_: SubgoalRequest) -> str:
        raise KeyError("defect")

    with pytest.raises(KeyError, match="defect"):
        PlannerClient(MockTransport(handler)).ask([request("0")])


def test_a_body_takes_as_long_as_its_slowest_request_and_no_longer_than_its_deadline() -> None:
    slept: list[float] = []
    latencies = {"0": 0.1, "1": 0.3, "2": 9.0}
    transport = MockTransport(lambda _: "stop", lambda asked: latencies[asked.request_id], sleep=slept.append)
    client = PlannerClient(transport)
    answers = client.ask([request("0"), request("1"), request("2", deadline=0.2)])
    assert slept == [0.3]
    assert [type(answer) for answer in answers] == [SubgoalReply, SubgoalReply, DeadlineExceeded]
    PlannerClient(MockTransport(lambda _: "stop", 0.5, sleep=slept.append)).ask([request("0")])
    assert slept == [0.3, 0.5]


def test_requests_travel_in_bodies_within_the_frame_limit() -> None:
    transport = Recording(max_frames=4)
    names = [str(index) for index in range(6)]
    answers = PlannerClient(transport).ask([request(name, recent=1) for name in names])
    assert transport.bodies == [["0", "1"], ["2", "3"], ["4", "5"]]
    assert [answer.request_id for answer in answers if isinstance(answer, SubgoalReply)] == names


def test_requests_travel_in_bodies_within_the_byte_limit() -> None:
    transport = Recording(max_body_bytes=8_000)
    PlannerClient(transport).ask([request(str(index)) for index in range(5)])
    assert transport.bodies == [["0", "1", "2"], ["3", "4"]]
    oversize = Recording(max_body_bytes=1)
    PlannerClient(oversize).ask([request("0"), request("1")])
    assert oversize.bodies == [["0"], ["1"]]


def test_no_requests_make_no_traffic() -> None:
    transport = Recording()
    client = PlannerClient(transport)
    assert client.ask([]) == []
    assert client.embed([]).shape == (0, 512)
    assert (transport.bodies, transport.texts) == ([], [])


def test_texts_are_embedded_in_order_and_in_parts() -> None:
    transport = Recording(max_texts=2)
    texts = ["find a chair", "find a bed", "find a sofa"]
    embeddings = PlannerClient(transport).embed(texts)
    assert transport.texts == [2, 1]
    assert embeddings.dtype == np.float32
    np.testing.assert_array_equal(embeddings, shipped_text_encoder().encode(texts))


def test_embeddings_of_another_space_or_number_are_refused() -> None:
    class Changed(MockTransport):
        def embed(self, request: EmbedRequest) -> EmbedReply:
            if len(request.texts) > 1:
                return super().embed(EmbedRequest(texts=request.texts[:1]))
            return EmbedReply(embedding_space="other@1", embeddings=np.zeros((1, 512), np.float32))

    client = PlannerClient(Changed(lambda _: "stop"))
    with pytest.raises(ProtocolMismatch, match="other@1"):
        client.embed(["find a chair"])
    with pytest.raises(ProtocolMismatch, match="1 embeddings of 2 texts"):
        client.embed(["find a chair", "find a bed"])


def test_a_service_that_has_changed_its_embedding_space_is_refused() -> None:
    spaces = {"0": None, "1": mock_info().embedding_space, "2": "other@1"}

    def handler(asked: SubgoalRequest) -> SubgoalReply:
        return reply_to(asked, "stop").model_copy(update={"embedding_space": spaces[asked.request_id]})

    answers = PlannerClient(MockTransport(handler)).ask([request(name) for name in spaces])
    assert [type(answer) for answer in answers] == [SubgoalReply, SubgoalReply, ProtocolMismatch]
    assert "now embeds in other@1" in str(answers[2])


def test_answers_that_do_not_belong_to_the_requests_are_refused() -> None:
    class Shuffled(MockTransport):
        def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
            return list(super().ask(requests))[::-1] if len(requests) == 2 else []

    client = PlannerClient(Shuffled(lambda _: "stop"))
    for count in (2, 3):
        answers = client.ask([request(str(index)) for index in range(count)])
        assert [type(answer) for answer in answers] == [ProtocolMismatch] * count


def test_counts_add_up_over_threads() -> None:
    client = PlannerClient(MockTransport(lambda r: "stop" if r.goal == "chair" else InvalidRequest("no")))

    def work() -> None:
        for _ in range(50):
            client.ask([request("0"), request("1", goal="bed"), request("2")])

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (client.counts.answered, client.counts.failed, client.counts.asked) == (400, 200, 600)


def test_the_context_closes_the_transport() -> None:
    transport = Recording()
    with PlannerClient(transport) as client:
        assert client.info.planner == "mock"
        assert not transport.closed
    assert transport.closed


def test_a_planner_that_does_not_say_who_it_is_cannot_be_asked() -> None:
    class Silent(MockTransport):
        def info(self) -> PlannerInfo:
            raise Unavailable("nobody there")

    with pytest.raises(Unavailable, match="nobody there"):
        PlannerClient(Silent(lambda _: "stop"))


def test_a_mock_plans_one_step() -> None:
    planned = reply_to(request("0").model_copy(update={"mode": "plan"}), "turn left")
    assert planned.instructions == ("turn left",)


def test_frames_are_jpeg_unless_raw_is_asked() -> None:
    image = np.random.default_rng(0).integers(0, 256, (256, 256, 3), dtype=np.uint8)[:, ::2]
    jpeg, raw = encode_frame(image, heading=0.5), encode_frame(image, "raw")
    assert (jpeg.encoding, jpeg.heading, jpeg.data[:2]) == ("jpeg", 0.5, b"\xff\xd8")
    assert (raw.encoding, raw.width, raw.height) == ("raw", 128, 256)
    assert raw.data == image.tobytes()
    with pytest.raises(ValueError, match="must be"):
        encode_frame(np.zeros((0, 4, 3), np.uint8))
