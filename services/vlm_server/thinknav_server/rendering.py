"""Answers as HTTP responses: binary for programs, JSON for people, errors in the contract's form in both."""

import math
from collections.abc import Sequence

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from thinknav_proto import (
    CONTENT_TYPE,
    PROTOCOL_VERSION,
    EmbedReply,
    Overloaded,
    PlannerError,
    PlannerInfo,
    SubgoalReply,
    encode_embed_reply,
    encode_error,
    encode_info,
    encode_replies,
)

BINARY_TYPES = (CONTENT_TYPE, "application/msgpack")


def media_type(request: Request) -> str:
    """The type of the body that the client sent, in lower case and without parameters."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def wants_binary(request: Request) -> bool:
    """Whether the client accepts msgpack by name or, naming nothing, has sent it."""
    accept = request.headers.get("accept", "").lower()
    if accept and any(kind in accept for kind in BINARY_TYPES):
        return True
    return "json" not in accept and media_type(request) in BINARY_TYPES


def render_replies(request: Request, answers: Sequence[SubgoalReply | PlannerError]) -> Response:
    """All answers of one body. The status is 200 if any is a reply, else that of the first error."""
    first_error = next((answer for answer in answers if isinstance(answer, PlannerError)), None)
    failed = first_error is not None and all(isinstance(answer, PlannerError) for answer in answers)
    status = first_error.http_status if first_error and failed else 200
    headers = _retry_header(first_error) if first_error and failed else {}
    if wants_binary(request):
        return Response(encode_replies(answers), status, headers, CONTENT_TYPE)
    replies = [
        {"error": answer.to_wire()}
        if isinstance(answer, PlannerError)
        else {"reply": answer.model_dump(mode="json", exclude_none=True)}
        for answer in answers
    ]
    return JSONResponse({"version": PROTOCOL_VERSION, "replies": replies}, status, headers)


def render_info(request: Request, info: PlannerInfo) -> Response:
    """Who answers."""
    if wants_binary(request):
        return Response(encode_info(info), media_type=CONTENT_TYPE)
    return JSONResponse({"version": PROTOCOL_VERSION, "info": info.model_dump(mode="json")})


def render_embeddings(request: Request, reply: EmbedReply) -> Response:
    """The embeddings of texts."""
    if wants_binary(request):
        return Response(encode_embed_reply(reply), media_type=CONTENT_TYPE)
    return JSONResponse({"version": PROTOCOL_VERSION, "embedded": reply.model_dump(mode="json")})


def render_error(request: Request, error: PlannerError, status: int | None = None) -> Response:
    """An error of the whole body, with its own status or the one given."""
    status, headers = status or error.http_status, _retry_header(error)
    if wants_binary(request):
        return Response(encode_error(error), status, headers, CONTENT_TYPE)
    return JSONResponse({"version": PROTOCOL_VERSION, "error": error.to_wire()}, status, headers)


def _retry_header(error: PlannerError) -> dict[str, str]:
    return {"Retry-After": str(max(1, math.ceil(error.retry_after)))} if isinstance(error, Overloaded) else {}
