"""Who asks, and as part of what: the name by which clients take turns, and the trace that a request belongs to.

Each door makes callers of what it knows of its clients; the service only passes them on.
"""

import re
import secrets
from dataclasses import dataclass
from typing import Self

# W3C Trace Context: version, trace id, parent id, flags. All-zero ids are invalid.
_TRACEPARENT = re.compile(r"([0-9a-f]{2})-([0-9a-f]{32})-([0-9a-f]{16})-([0-9a-f]{2})(-.*)?")


@dataclass(frozen=True)
class Trace:
    """A W3C trace context.

    trace_id: 32 hex digits. flags: 2 hex digits. state: the `tracestate` header as it came, "" without one.
    """

    trace_id: str
    flags: str = "01"
    state: str = ""

    @classmethod
    def read(cls, traceparent: str | None, tracestate: str | None = None) -> Self | None:
        """The context that the two headers tell of; None, as the standard asks, for a header that is not valid."""
        match = _TRACEPARENT.fullmatch(traceparent.strip()) if traceparent else None
        if match is None:
            return None
        version, trace_id, parent_id, flags, rest = match.groups()
        if version == "ff" or (version == "00" and rest) or not (int(trace_id, 16) and int(parent_id, 16)):
            return None
        return cls(trace_id, flags, (tracestate or "")[:512])

    def headers(self) -> dict[str, str]:
        """Headers for a call made in the course of this trace, under a fresh parent id."""
        headers = {"traceparent": f"00-{self.trace_id}-{secrets.token_hex(8)}-{self.flags}"}
        return headers | ({"tracestate": self.state} if self.state else {})


@dataclass(frozen=True)
class Caller:
    """name: clients of one name share their turns at the planner. door: by which the request came."""

    name: str = "anonymous"
    door: str = "python"
    trace: Trace | None = None

    @classmethod
    def of_attachment(cls, attachment: bytes) -> Self:
        """Who asks over zenoh, which tells nothing else of a client: lines of a name, `traceparent` and `tracestate`.

        Each may be missing, and the lines after the name with it.
        """
        name, traceparent, tracestate, *_ = [*attachment[:1024].decode("utf-8", "replace").split("\n"), "", "", ""]
        return cls(name[:64] or "unnamed", "zenoh", Trace.read(traceparent, tracestate))


ANONYMOUS = Caller()
