"""The page from which others implement the contract tells the truth."""

import re
from pathlib import Path

import pytest

from thinknav_proto import (
    ALL_ALIVE,
    CONTENT_TYPE,
    PROTOCOL_VERSION,
    Frame,
    Limits,
    Overloaded,
    PlannerError,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
    Timings,
    decode_replies,
    decode_requests,
    encode_error,
    encode_requests,
)
from thinknav_proto.codec import MAX_ARRAY_LENGTH, MAX_MAP_LENGTH

README = (Path(__file__).parents[2] / "proto" / "README.md").read_text(encoding="utf-8")


def example(name: str) -> bytes:
    match = re.search(rf"```hex {name}\n(.*?)```", README, re.DOTALL)
    assert match
    return bytes.fromhex(match.group(1))


def test_the_request_example_is_what_we_read_and_write() -> None:
    frame = Frame(encoding="raw", data=bytes([255, 128, 0]), width=1, height=1)
    request = SubgoalRequest(request_id="7", goal="chair", frame=frame)
    assert decode_requests(example("request")) == [request]
    assert encode_requests([request]) == example("request")


def test_the_error_example_is_what_we_read_and_write() -> None:
    with pytest.raises(Overloaded, match="the queue is full") as raised:
        decode_replies(example("error"))
    assert raised.value.retry_after == 0.5
    assert encode_error(raised.value) == example("error")


@pytest.mark.parametrize("branch", PlannerError.__subclasses__())
def test_every_error_is_listed_with_its_status(branch: type[PlannerError]) -> None:
    assert f"| `{branch.code}` | {branch.http_status} |" in README


@pytest.mark.parametrize("message", [SubgoalRequest, Frame, SubgoalReply, Timings, PlannerInfo, Limits])
def test_every_field_is_described(message: type[SubgoalRequest]) -> None:
    missing = [name for name in message.model_fields if f"`{name}`" not in README]
    assert missing == []


def test_numbers_and_names_are_those_of_the_code() -> None:
    assert f"version {PROTOCOL_VERSION}\n" in README
    assert f"`{CONTENT_TYPE}`" in README
    assert f"`{ALL_ALIVE}`" in README
    assert f"at most {MAX_ARRAY_LENGTH:,} items and a map at most {MAX_MAP_LENGTH} keys" in README
