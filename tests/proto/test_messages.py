"""What the messages themselves refuse, and what they promise: immutability, equality, JSON."""

import json

import numpy as np
import pytest
from pydantic import ValidationError

from thinknav_proto import EmbedReply, Frame, SubgoalReply, SubgoalRequest, Timings, describe


def a_reply(embedding: object) -> SubgoalReply:
    return SubgoalReply.model_validate(
        {
            "request_id": "7",
            "subgoal": "turn left",
            "embedding": embedding,
            "planner": "scripted@1",
            "timings": Timings(queued=0.0, planned=0.1, embedded=0.0),
        }
    )


def test_a_raw_frame_keeps_the_pixels_row_by_row() -> None:
    rgb = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    frame = Frame.raw(rgb, heading=0.5)
    assert (frame.width, frame.height, frame.heading) == (3, 2, 0.5)
    assert frame.data == bytes(range(18))


@pytest.mark.parametrize("image", [np.zeros((2, 3)), np.zeros((2, 3, 4), np.uint8), np.zeros((2, 3, 3))])
def test_an_image_of_another_shape_or_type_is_no_frame(image: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"must be \(H, W, 3\) uint8"):
        Frame.raw(image)


def test_an_embedding_is_a_copy_that_cannot_be_written() -> None:
    vector = np.ones(512, np.float32)
    reply = a_reply(vector)
    vector[:] = 7
    assert reply.embedding.max() == 1
    with pytest.raises(ValueError, match="read-only"):
        reply.embedding[0] = 2


@pytest.mark.parametrize(
    ("embedding", "message"),
    [
        (np.zeros(512), "must be float32"),
        (np.zeros(511, np.float32), r"shape \(512,\), not \(511,\)"),
        (np.zeros((2, 512), np.float32), r"not \(2, 512\)"),
        (b"1234", "4 bytes"),
        ([0.0] * 512, "not list"),
    ],
)
def test_what_is_no_embedding_is_refused(embedding: object, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        a_reply(embedding)


def test_replies_are_equal_when_all_values_are() -> None:
    assert a_reply(np.ones(512, np.float32)) == a_reply(np.ones(512, np.float32))
    assert a_reply(np.ones(512, np.float32)) != a_reply(np.zeros(512, np.float32))


def test_a_reply_survives_json() -> None:
    reply = a_reply(np.linspace(-1, 1, 512, dtype=np.float32))
    text = reply.model_dump_json()
    assert len(json.loads(text)["embedding"]) == 512
    assert SubgoalReply.model_validate_json(text) == reply


def test_json_embeddings_must_be_rows_of_one_width() -> None:
    with pytest.raises(ValidationError, match="list of numbers"):
        EmbedReply.model_validate_json('{"embedding_space": "a@1", "embeddings": [[1, 2], [3]]}')
    with pytest.raises(ValidationError, match=r"shape \(N, 512\)"):
        EmbedReply.model_validate_json('{"embedding_space": "a@1", "embeddings": [[1, 2]]}')


def test_messages_are_frozen() -> None:
    frame = Frame(encoding="jpeg", data=b"1")
    with pytest.raises(ValidationError, match="frozen"):
        frame.__setattr__("heading", 1.0)


def test_a_described_error_is_short_and_does_not_repeat_the_value() -> None:
    with pytest.raises(ValidationError) as raised:
        SubgoalRequest.model_validate({"request_id": "7", "goal": 3, "secret" * 200: 1})
    text = describe(raised.value)
    assert text.startswith("goal: ")
    assert len(text) <= 300


def test_frames_of_a_request_end_with_its_own() -> None:
    old, new = Frame(encoding="jpeg", data=b"old", heading=1.0), Frame(encoding="jpeg", data=b"new")
    assert SubgoalRequest(request_id="1", goal="bed", frame=new, recent=(old,)).frames == (old, new)
