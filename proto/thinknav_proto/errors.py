"""The ways in which asking a planner can fail, the same on both sides of the wire.

    PlannerError
    ├── InvalidRequest      the request breaks the contract or a limit; sending it again will not help
    ├── Unauthenticated     the service does not know the client
    ├── Overloaded          the queue is full; ask again after `retry_after` seconds
    ├── DeadlineExceeded    no answer within the request's deadline
    ├── PlannerFailed       the planner itself broke on this request
    ├── Unavailable         no service, or one that is starting or stopping
    └── ProtocolMismatch    the other side speaks another protocol, or another version of it

Each error has one code, which the wire carries, and one HTTP status. Over zenoh the same encoded error body
is sent as the error reply. This module knows neither HTTP libraries nor zenoh.
"""

import math
from typing import ClassVar, Self


class PlannerError(Exception):
    """The root of the tree; catch it to catch every failure of asking. Only its branches are raised."""

    code: ClassVar[str] = "planner_error"
    http_status: ClassVar[int] = 500

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message

    def to_wire(self) -> dict[str, object]:
        """The error as a map of plain values, for msgpack or JSON."""
        return {"code": self.code, "message": self.message}

    def as_value(self) -> Self:
        """This error as an answer among others, for whoever catches it to give it on without raising it.

        It forgets where it came from: a traceback holds the frames that it went through, with all that they hold, and
        as soon as one of them keeps the error in a list, frames and pictures stay until the garbage is collected.
        """
        self.__traceback__ = self.__context__ = self.__cause__ = None
        return self


class InvalidRequest(PlannerError):
    """The request breaks the contract or one of the service's limits."""

    code = "invalid_request"
    http_status = 400


class Unauthenticated(PlannerError):
    """The service does not know the client, or its token is wrong."""

    code = "unauthenticated"
    http_status = 401


class Overloaded(PlannerError):
    """The service has more to do than it can finish in time.

    retry_after: seconds after which asking again is worth a try.
    """

    code = "overloaded"
    http_status = 429

    def __init__(self, message: str, retry_after: float = 1.0) -> None:
        super().__init__(message)
        self.retry_after = retry_after

    def to_wire(self) -> dict[str, object]:
        return {**super().to_wire(), "retry_after": self.retry_after}


class DeadlineExceeded(PlannerError):
    """The answer did not come within the request's deadline."""

    code = "deadline_exceeded"
    http_status = 504


class PlannerFailed(PlannerError):
    """The planner raised, or answered nonsense, on this request."""

    code = "planner_failed"
    http_status = 502


class Unavailable(PlannerError):
    """There is no service to ask, or it is starting or stopping."""

    code = "unavailable"
    http_status = 503


class ProtocolMismatch(PlannerError):
    """The other side does not speak this version of the protocol."""

    code = "protocol_mismatch"
    http_status = 409


_BY_CODE: dict[str, type[PlannerError]] = {
    branch.code: branch
    for branch in (
        InvalidRequest,
        Unauthenticated,
        Overloaded,
        DeadlineExceeded,
        PlannerFailed,
        Unavailable,
        ProtocolMismatch,
    )
}


def error_from_wire(wire: object) -> PlannerError:
    """The error that a wire map tells of.

    A map that is no error is itself a ProtocolMismatch; a code that this version does not know becomes
    PlannerFailed, with the code in its message.
    """
    if not isinstance(wire, dict):
        return ProtocolMismatch(f"an error must be a map, not {type(wire).__name__}")
    code, message = wire.get("code"), wire.get("message")
    if not isinstance(code, str) or not isinstance(message, str):
        return ProtocolMismatch("an error must have the strings 'code' and 'message'")
    if code == Overloaded.code:
        retry_after = wire.get("retry_after")
        if isinstance(retry_after, float | int) and math.isfinite(retry_after) and retry_after >= 0:
            return Overloaded(message, float(retry_after))
        return Overloaded(message)
    branch = _BY_CODE.get(code)
    return branch(message) if branch else PlannerFailed(f"{code[:64]}: {message}")
