"""Trace contexts are read as the W3C standard asks, and passed on."""

import pytest

from thinknav_server.caller import Caller, Trace

ID = "4bf92f3577b34da6a3ce929d0e0e4736"
PARENT = "00f067aa0ba902b7"


def test_a_trace_is_passed_on_under_a_fresh_parent() -> None:
    trace = Trace.read(f"00-{ID}-{PARENT}-00", "vendor=1")
    assert trace == Trace(ID, "00", "vendor=1")
    assert trace is not None
    first, second = trace.headers(), trace.headers()
    version, trace_id, parent, flags = first["traceparent"].split("-")
    assert (version, trace_id, flags) == ("00", ID, "00")
    assert len({parent, PARENT, second["traceparent"].split("-")[2]}) == 3
    assert first["tracestate"] == "vendor=1"
    assert "tracestate" not in Trace(ID).headers()


def test_a_later_version_may_say_more() -> None:
    assert Trace.read(f"01-{ID}-{PARENT}-01-more") == Trace(ID)


@pytest.mark.parametrize(
    "header",
    [
        None,
        "",
        "nonsense",
        f"00-{ID}-{PARENT}",
        f"00-{ID}-{PARENT}-01-more",
        f"ff-{ID}-{PARENT}-01",
        f"00-{'0' * 32}-{PARENT}-01",
        f"00-{ID}-{'0' * 16}-01",
        f"00-{ID.upper()}-{PARENT}-01",
    ],
)
def test_what_is_not_valid_is_no_trace(header: str | None) -> None:
    assert Trace.read(header) is None


@pytest.mark.parametrize(
    ("attachment", "caller"),
    [
        (b"", Caller("unnamed", "zenoh")),
        (b"robot", Caller("robot", "zenoh")),
        (f"robot\n00-{ID}-{PARENT}-01".encode(), Caller("robot", "zenoh", Trace(ID))),
        (f"\n00-{ID}-{PARENT}-00\nvendor=1".encode(), Caller("unnamed", "zenoh", Trace(ID, "00", "vendor=1"))),
        (b"robot\nnonsense\nvendor=1", Caller("robot", "zenoh")),
        (b"r" * 5000, Caller("r" * 64, "zenoh")),
        (b"\xff\n\n\n\n", Caller("\ufffd", "zenoh")),
    ],
)
def test_over_zenoh_a_caller_tells_its_name_and_trace(attachment: bytes, caller: Caller) -> None:
    assert Caller.of_attachment(attachment) == caller
