"""Messages to bytes and back: one msgpack map for each body, the same over HTTP and zenoh.

Whoever decodes trusts nothing: whatever the bytes are, a request's decoder raises InvalidRequest or
ProtocolMismatch, a reply's decoder ProtocolMismatch or the error that the body tells of, and neither
allocates what a header merely claims. `README.md` beside this package writes the schema down.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

import msgpack
from pydantic import ValidationError

from thinknav_proto.errors import InvalidRequest, PlannerError, ProtocolMismatch, error_from_wire
from thinknav_proto.messages import (
    PROTOCOL_VERSION,
    EmbedReply,
    EmbedRequest,
    Message,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
)

CONTENT_TYPE = "application/vnd.thinknav+msgpack"

# An array header costs 5 bytes and may claim 4 billion items; these bound what a decoder reserves for a claim.
MAX_ARRAY_LENGTH = 4096
MAX_MAP_LENGTH = 64

_M = TypeVar("_M", bound=Message)


def encode_requests(requests: Sequence[SubgoalRequest]) -> bytes:
    """A body that asks for one subgoal for each request."""
    return _pack(requests=[request.model_dump(exclude_none=True) for request in requests])


def decode_requests(body: bytes) -> list[SubgoalRequest | PlannerError]:
    """The requests of a body, in its order; an item that is wrong stands there as its error.

    Raises InvalidRequest or ProtocolMismatch when the body as a whole cannot be read.
    """
    items = _items(_open(body, InvalidRequest), "requests", InvalidRequest)
    return [_request(index, item) for index, item in enumerate(items)]


def encode_replies(answers: Iterable[SubgoalReply | PlannerError]) -> bytes:
    """A body that answers each request with a reply or an error, in the order asked."""
    return _pack(
        replies=[
            {"error": answer.to_wire()}
            if isinstance(answer, PlannerError)
            else {"reply": answer.model_dump(exclude_none=True)}
            for answer in answers
        ]
    )


def decode_replies(body: bytes) -> list[SubgoalReply | PlannerError]:
    """The answers of a body, in its order. Raises the error that the body tells of, or ProtocolMismatch."""
    items = _items(_open_reply(body), "replies", ProtocolMismatch)
    return [_answer(index, item) for index, item in enumerate(items)]


def encode_error(error: PlannerError) -> bytes:
    """A body that says why nothing in it could be answered."""
    return _pack(error=error.to_wire())


def encode_info(info: PlannerInfo) -> bytes:
    """A body that says who answers."""
    return _pack(info=info.model_dump())


def decode_info(body: bytes) -> PlannerInfo:
    """Who answers. Raises the error that the body tells of, or ProtocolMismatch."""
    return _validate(PlannerInfo, _open_reply(body).get("info"), "info", ProtocolMismatch)


def encode_embed_request(request: EmbedRequest) -> bytes:
    """A body that asks for embeddings."""
    return _pack(embed=request.model_dump())


def decode_embed_request(body: bytes) -> EmbedRequest:
    """The texts to embed. Raises InvalidRequest or ProtocolMismatch."""
    return _validate(EmbedRequest, _open(body, InvalidRequest).get("embed"), "embed", InvalidRequest)


def encode_embed_reply(reply: EmbedReply) -> bytes:
    """A body that gives embeddings."""
    return _pack(embedded=reply.model_dump())


def decode_embed_reply(body: bytes) -> EmbedReply:
    """The embeddings. Raises the error that the body tells of, or ProtocolMismatch."""
    return _validate(EmbedReply, _open_reply(body).get("embedded"), "embedded", ProtocolMismatch)


def describe(error: ValidationError) -> str:
    """What is wrong with a message and where, in one short line without the values it holds."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    reason = first["msg"].removeprefix("Value error, ")
    return f"{where}: {reason}"[:300] if where else reason[:300]


def _pack(**content: object) -> bytes:
    body: bytes = msgpack.packb({"version": PROTOCOL_VERSION, **content}, use_bin_type=True)
    return body


def _open(body: bytes, malformed: type[PlannerError]) -> Mapping[str, object]:
    """The map of a body whose version is ours. Raises `malformed`, or ProtocolMismatch."""
    try:
        content = msgpack.unpackb(
            body,
            raw=False,
            use_list=False,
            strict_map_key=True,
            max_array_len=min(len(body), MAX_ARRAY_LENGTH),
            max_map_len=min(len(body), MAX_MAP_LENGTH),
            max_str_len=len(body),
            max_bin_len=len(body),
            max_ext_len=0,
        )
    except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
        raise malformed(f"the body is not valid msgpack: {str(error)[:200] or type(error).__name__}") from None
    if not isinstance(content, dict):
        raise malformed(f"the body must be a msgpack map, not {type(content).__name__}")
    _check_version(content.get("version"), malformed)
    return content


def _check_version(version: object, malformed: type[PlannerError]) -> None:
    if not isinstance(version, int) or isinstance(version, bool):
        raise malformed("the body must state its protocol version, a whole number, as 'version'")
    if version != PROTOCOL_VERSION:
        raise ProtocolMismatch(f"this side speaks protocol version {PROTOCOL_VERSION}, the other side {version}")


def _open_reply(body: bytes) -> Mapping[str, object]:
    """The map of a body that is not an error; raises the error of one that is."""
    content = _open(body, ProtocolMismatch)
    if "error" in content:
        raise error_from_wire(content["error"])
    return content


def _items(content: Mapping[str, object], name: str, malformed: type[PlannerError]) -> tuple[object, ...]:
    items = content.get(name)
    if not isinstance(items, tuple):
        raise malformed(f"the body must have an array '{name}'")
    return items


def _request(index: int, item: object) -> SubgoalRequest | PlannerError:
    try:
        if isinstance(item, dict) and "protocol_version" in item:
            _check_version(item["protocol_version"], InvalidRequest)
        return _validate(SubgoalRequest, item, f"request {index}", InvalidRequest)
    except PlannerError as error:
        return error.as_value()


def _answer(index: int, item: object) -> SubgoalReply | PlannerError:
    if isinstance(item, dict) and "error" in item:
        return error_from_wire(item["error"])
    try:
        fields = item.get("reply") if isinstance(item, dict) else item
        return _validate(SubgoalReply, fields, f"reply {index}", ProtocolMismatch)
    except PlannerError as error:
        return error.as_value()


def _validate(kind: type[_M], fields: object, where: str, malformed: type[PlannerError]) -> _M:
    if not isinstance(fields, dict):
        raise malformed(f"{where}: must be a map")
    try:
        return kind.model_validate(fields)
    except ValidationError as error:
        raise malformed(f"{where}: {describe(error)}") from None
