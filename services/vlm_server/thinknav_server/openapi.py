"""What the routes read and answer, as the page /openapi.json tells it: they read bodies themselves, unseen by FastAPI.

The msgpack form is bytes to OpenAPI; its fields stand in the contract.
"""

from typing import Any

from thinknav_proto import (
    CONTENT_TYPE,
    PROTOCOL_VERSION,
    EmbedReply,
    EmbedRequest,
    InvalidRequest,
    Overloaded,
    PlannerError,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
    Unauthenticated,
    Unavailable,
)
from thinknav_proto.errors import DeadlineExceeded, PlannerFailed

Json = dict[str, Any]
Responses = dict[int | str, Json]

_MSGPACK: Json = {"schema": {"type": "string", "format": "binary"}}
_REQUEST: Json = SubgoalRequest.model_json_schema()["properties"]


def subgoals_body() -> Json:
    """The body of POST /v1/subgoals."""
    fields: Json = {name: _REQUEST[name] for name in ("goal", "mode", "temperature", "deadline")}
    frame: Json = {"type": "string", "format": "binary", "description": "A JPEG or PNG; may be given several times."}
    form: Json = {
        "schema": {
            "type": "object",
            "properties": {**fields, "frame": frame},
            "required": ["goal", "frame"],
            "additionalProperties": False,
        },
        "example": {"goal": "chair", "frame": "(the bytes of view.jpg)"},
    }
    return _body({"multipart/form-data": form, CONTENT_TYPE: _MSGPACK})


def embeddings_body() -> Json:
    """The body of POST /v1/embeddings."""
    texts = {"schema": EmbedRequest.model_json_schema(), "example": {"texts": ["turn left toward the doorway"]}}
    return _body({"application/json": texts, CONTENT_TYPE: _MSGPACK})


def subgoals_answers() -> Responses:
    """The answers of POST /v1/subgoals."""
    reply: Json = _object(reply=_schema(SubgoalReply))
    replies: Json = {"type": "array", "items": {"anyOf": [reply, _object(error=_ERROR)]}}
    failures = (InvalidRequest, Unauthenticated, Overloaded, PlannerFailed, Unavailable, DeadlineExceeded)
    answers = _answers(_told(replies=replies), "One answer for each frame, in order; some may be errors.", *failures)
    for error in failures:  # each frame of the body failed, or the body as a whole
        schema = answers[error.http_status]["content"]["application/json"]
        schema["schema"] = {"anyOf": [_told(error=_ERROR), _told(replies=replies)]}
    return answers


def embeddings_answers() -> Responses:
    """The answers of POST /v1/embeddings."""
    failures = (InvalidRequest, Unauthenticated, Overloaded, PlannerFailed, Unavailable)
    return _answers(_told(embedded=_schema(EmbedReply)), "The texts' embeddings, in order.", *failures)


def planner_answers() -> Responses:
    """The answers of GET /v1/planner."""
    return _answers(_told(info=_schema(PlannerInfo)), "Who answers.", Unauthenticated, Unavailable)


def readiness_answers() -> Responses:
    """The answers of GET /readyz."""
    answers = _answers(_object(status={"const": "ready"}), "Requests are answered.", Unavailable)
    del answers[200]["content"][CONTENT_TYPE]
    return answers


def page_answers(kind: str) -> Responses:
    """The answers of a page for people or for Prometheus. kind: its media type."""
    return {200: {"content": {kind: {"schema": {"type": "string"}}}}, 401: _failure(Unauthenticated)}


_ERROR: Json = {
    "type": "object",
    "properties": {
        "code": {"type": "string"},
        "message": {"type": "string"},
        "retry_after": {"type": "number", "description": "Seconds; of `overloaded` alone."},
    },
    "required": ["code", "message"],
}


def _answers(good: Json, description: str, *errors: type[PlannerError]) -> Responses:
    content = {"application/json": {"schema": good}, CONTENT_TYPE: _MSGPACK}
    answers: Responses = {200: {"description": description, "content": content}}
    return answers | {error.http_status: _failure(error) for error in errors}


def _failure(error: type[PlannerError]) -> Json:
    content = {"application/json": {"schema": _told(error=_ERROR)}, CONTENT_TYPE: _MSGPACK}
    return {"description": f"`{error.code}`: {(error.__doc__ or '').strip().splitlines()[0]}", "content": content}


def _told(**field: Json) -> Json:
    return _object(version={"const": PROTOCOL_VERSION}, **field)


def _object(**properties: Json) -> Json:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _body(content: Json) -> Json:
    return {"requestBody": {"required": True, "content": content}}


def _schema(message: type[SubgoalReply | EmbedReply | PlannerInfo]) -> Json:
    """In JSON an embedding is a list of numbers, whatever else it may be in msgpack."""
    schema = message.model_json_schema(mode="serialization")
    definitions: Json = schema.pop("$defs", {})
    properties: Json = schema["properties"]
    for name, value in properties.items():
        if "$ref" in value:
            properties[name] = definitions[value["$ref"].rpartition("/")[2]]
    numbers: Json = {"type": "array", "items": {"type": "number"}}
    if "embedding" in properties:
        properties["embedding"] = numbers
    if "embeddings" in properties:
        properties["embeddings"] = {"type": "array", "items": numbers}
    return schema
