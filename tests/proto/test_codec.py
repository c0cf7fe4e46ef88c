"""Every message survives the wire, and no bytes whatever make a decoder do anything but name an error."""

import struct
import tracemalloc
from collections.abc import Callable

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from thinknav_proto import (
    DeadlineExceeded,
    EmbedReply,
    EmbedRequest,
    Frame,
    InvalidRequest,
    Limits,
    Overloaded,
    PlannerError,
    PlannerFailed,
    PlannerInfo,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
    Timings,
    decode_embed_reply,
    decode_embed_request,
    decode_info,
    decode_replies,
    decode_requests,
    encode_embed_reply,
    encode_embed_request,
    encode_error,
    encode_info,
    encode_replies,
    encode_requests,
)

REQUEST_DECODERS = (decode_requests, decode_embed_request)
REPLY_DECODERS = (decode_replies, decode_info, decode_embed_reply)

texts = st.text(min_size=1, max_size=40)
seconds = st.floats(0, 1e6)
counts = st.integers(1, 2**40)
names = st.from_regex(r"[A-Za-z0-9_.-]{1,20}", fullmatch=True)
embeddings = hnp.arrays(np.float32, 512, elements=st.floats(-10, 10, width=32))
headings = st.floats(-10, 10)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    if draw(st.booleans()):
        height, width = draw(st.integers(1, 4)), draw(st.integers(1, 4))
        return Frame.raw(draw(hnp.arrays(np.uint8, (height, width, 3))), draw(headings))
    data = draw(st.binary(min_size=1, max_size=30))
    if draw(st.booleans()):
        return Frame(encoding="png", data=data, heading=draw(headings))
    return Frame(encoding="jpeg", data=data, heading=draw(headings))


requests = st.builds(
    SubgoalRequest,
    request_id=st.text(min_size=1, max_size=20),
    goal=texts,
    frame=frames(),
    mode=st.sampled_from(["subgoal", "plan"]),
    recent=st.lists(frames(), max_size=3).map(tuple),
    temperature=st.floats(0, 10),
    deadline=st.floats(0.001, 3600),
)
replies = st.builds(
    SubgoalReply,
    request_id=st.text(max_size=20),
    subgoal=texts,
    instructions=st.lists(texts, max_size=3).map(tuple),
    embedding=embeddings,
    confidence=st.none() | st.floats(0, 1),
    planner=st.builds("{}@{}".format, names, names),
    timings=st.builds(Timings, queued=seconds, planned=seconds, embedded=seconds),
)
errors = st.one_of(
    st.builds(DeadlineExceeded, texts),
    st.builds(PlannerFailed, texts),
    st.builds(Overloaded, texts, st.floats(0, 1e6)),
)
limits = st.builds(
    Limits,
    max_frames=counts,
    max_pixels=counts,
    max_body_bytes=counts,
    max_text_length=counts,
    max_texts=counts,
)
infos = st.builds(
    PlannerInfo,
    protocol_version=st.integers(1, 9),
    planner=names,
    revision=names,
    prompt_hash=names,
    embedding_space=st.builds("{}@{}".format, names, names),
    limits=limits,
)


def as_values(answers: list[SubgoalReply | PlannerError]) -> list[object]:
    """Errors have no equality of their own."""
    return [answer.to_wire() if isinstance(answer, PlannerError) else answer for answer in answers]


def a_request() -> SubgoalRequest:
    return SubgoalRequest(request_id="7", goal="chair", frame=Frame.raw(np.zeros((2, 3, 3), np.uint8)))


def a_body(**changes: object) -> bytes:
    """A body with one raw request, some of whose fields are replaced."""
    fields = {**a_request().model_dump(), **changes}
    body: bytes = msgpack.packb({"version": 1, "requests": [fields]})
    return body


@settings(deadline=None, max_examples=60)
@given(st.lists(requests, max_size=3))
def test_requests_round_trip(asked: list[SubgoalRequest]) -> None:
    assert decode_requests(encode_requests(asked)) == asked


@settings(deadline=None, max_examples=60)
@given(st.lists(replies | errors, max_size=3))
def test_replies_round_trip(answers: list[SubgoalReply | PlannerError]) -> None:
    assert as_values(decode_replies(encode_replies(answers))) == as_values(answers)


@settings(deadline=None, max_examples=40)
@given(infos)
def test_info_round_trips(info: PlannerInfo) -> None:
    assert decode_info(encode_info(info)) == info


@settings(deadline=None, max_examples=40)
@given(
    st.lists(texts, min_size=1, max_size=5),
    hnp.arrays(np.float32, (2, 512), elements=st.floats(-1, 1, width=32)),
)
def test_embeddings_round_trip(asked: list[str], vectors: NDArray[np.float32]) -> None:
    request = EmbedRequest(texts=tuple(asked))
    assert decode_embed_request(encode_embed_request(request)) == request
    reply = EmbedReply(embedding_space="words@1", embeddings=vectors)
    decoded = decode_embed_reply(encode_embed_reply(reply))
    assert decoded == reply
    np.testing.assert_array_equal(decoded.embeddings, vectors)


@settings(deadline=None, max_examples=40)
@given(errors)
def test_every_reply_decoder_raises_the_error_that_it_is_told(error: PlannerError) -> None:
    for decode in REPLY_DECODERS:
        with pytest.raises(type(error)) as raised:
            decode(encode_error(error))
        assert raised.value.to_wire() == error.to_wire()


wire_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


def check_decoders_name_an_error_or_succeed(body: bytes) -> None:
    for ask in REQUEST_DECODERS:
        try:
            ask(body)
        except (InvalidRequest, ProtocolMismatch) as error:
            assert error.message  # noqa: PT017 - either outcome is right
    for answer in REPLY_DECODERS:
        try:
            answer(body)
        except PlannerError as error:
            assert not isinstance(error, InvalidRequest) or b"invalid_request" in body  # noqa: PT017


@settings(deadline=None, max_examples=300)
@given(st.binary(max_size=200))
def test_arbitrary_bytes_are_refused_by_name(body: bytes) -> None:
    check_decoders_name_an_error_or_succeed(body)


@settings(deadline=None, max_examples=200)
@given(st.dictionaries(st.sampled_from(["requests", "replies", "embed", "embedded", "info", "error"]), wire_values))
def test_arbitrary_content_is_refused_by_name(content: dict[str, object]) -> None:
    check_decoders_name_an_error_or_succeed(msgpack.packb({"version": 1, **content}))


@settings(deadline=None, max_examples=200)
@given(st.sampled_from([*SubgoalRequest.model_fields, "surprise"]), wire_values)
def test_an_arbitrary_field_spoils_only_its_item(field: str, value: object) -> None:
    fields = a_request().model_dump()
    body = msgpack.packb({"version": 1, "requests": [{**fields, field: value}, fields]})
    first, second = decode_requests(body)
    assert isinstance(first, SubgoalRequest | InvalidRequest | ProtocolMismatch)
    assert second == a_request()


def test_every_truncation_is_refused() -> None:
    body = encode_requests([a_request()])
    for length in range(len(body)):
        with pytest.raises(InvalidRequest):
            decode_requests(body[:length])
    with pytest.raises(InvalidRequest, match="not valid msgpack"):
        decode_requests(body + b"\x00")


@pytest.mark.parametrize("header", [b"\xdd\x7f\xff\xff\xff", b"\xdf\x7f\xff\xff\xff", b"\xc6\xff\xff\xff\xff"])
def test_nothing_is_allocated_for_what_a_header_claims(header: bytes) -> None:
    body = b"\x81\xa8requests" + header * 2000
    tracemalloc.start()
    with pytest.raises(InvalidRequest):
        decode_requests(body)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1_000_000


def test_nested_claims_that_each_keep_the_limit_stay_small() -> None:
    body = b"\x81\xa8requests" + b"\xdc\x0f\xff" * 5000
    tracemalloc.start()
    with pytest.raises(InvalidRequest):
        decode_requests(body)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 64_000_000


@pytest.mark.parametrize("decode", [*REQUEST_DECODERS, *REPLY_DECODERS])
def test_another_version_is_a_mismatch_that_names_both(decode: Callable[[bytes], object]) -> None:
    with pytest.raises(ProtocolMismatch, match="version 1, the other side 2"):
        decode(msgpack.packb({"version": 2, "requests": "of another shape"}))


def test_an_item_of_another_version_is_a_mismatch() -> None:
    (answer,) = decode_requests(a_body(protocol_version=2))
    assert isinstance(answer, ProtocolMismatch)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"goal": b"chair"}, "goal"),
        ({"temperature": float("nan")}, "temperature"),
        ({"deadline": 0.0}, "deadline"),
        ({"temprature": 0.5}, "temprature"),
        ({"frame": {"encoding": "raw", "data": b"123456", "width": 2, "height": 2}}, "has 12 bytes, not 6"),
        ({"frame": {"encoding": "raw", "data": b"1", "width": 2**40, "height": 2**40}}, "bytes, not 1"),
        ({"frame": {"encoding": "raw", "data": b"123"}}, "needs width and height"),
        ({"frame": {"encoding": "jpeg", "data": b"123", "width": 1, "height": 1}}, "states its own size"),
        ({"frame": {"encoding": "webp", "data": b"123"}}, "frame.encoding"),
        ({"frame": None}, "frame"),
    ],
)
def test_a_wrong_field_is_named(changes: dict[str, object], message: str) -> None:
    (answer,) = decode_requests(a_body(**changes))
    assert isinstance(answer, InvalidRequest)
    assert answer.message.startswith("request 0: ")
    assert message in answer.message


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_embeddings_that_are_not_finite_are_refused(value: float) -> None:
    vectors = np.zeros((1, 512), np.float32)
    body = bytearray(encode_embed_reply(EmbedReply(embedding_space="words@1", embeddings=vectors)))
    body[-4:] = struct.pack("<f", value)
    with pytest.raises(ProtocolMismatch, match="NaN or infinity"):
        decode_embed_reply(bytes(body))


def test_a_reply_that_is_no_reply_is_a_mismatch_of_its_own_item() -> None:
    answers = decode_replies(msgpack.packb({"version": 1, "replies": [{"reply": {"subgoal": "stop"}}, 3]}))
    assert [type(answer) for answer in answers] == [ProtocolMismatch, ProtocolMismatch]


def test_fields_that_a_later_service_adds_to_what_it_tells_are_ignored() -> None:
    reply = SubgoalReply(
        request_id="7",
        subgoal="stop",
        embedding=np.zeros(512, np.float32),
        planner="scripted@1",
        timings=Timings(queued=0, planned=0, embedded=0),
    )
    told = {**reply.model_dump(), "mood": "sunny"}
    assert decode_replies(msgpack.packb({"version": 1, "replies": [{"reply": told}]})) == [reply]
