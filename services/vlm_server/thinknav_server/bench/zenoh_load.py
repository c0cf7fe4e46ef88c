"""One client that asks over zenoh, one question after another."""

import time
from collections.abc import Sequence

import zenoh

from thinknav_proto import subgoal_key
from thinknav_server.bench.load import Tally

_PATIENCE_S = 30.0
_MEET_S = 10.0


def lone_loop(place: str, replica: str, bodies: Sequence[bytes], seconds: float) -> Tally:
    """Ask for so long. place: HOST:PORT of the service. An error counts as a 500. The first fifth is not counted."""
    config = zenoh.Config()
    for path, value in (
        ("mode", '"client"'),
        ("connect/endpoints", f'["tcp/{place}"]'),
        ("scouting/multicast/enabled", "false"),
    ):
        config.insert_json5(path, value)
    tally = Tally(seconds=seconds)
    with zenoh.open(config) as session:
        querier = session.declare_querier(subgoal_key(replica), timeout=_PATIENCE_S)
        _wait_for_answer(querier, bodies[0])
        began = time.perf_counter() + seconds / 5
        turn = 0
        while (asked := time.perf_counter()) < began + seconds:
            replied = _ask(querier, bodies[turn % len(bodies)])
            taken = time.perf_counter() - asked
            turn += 1
            if asked >= began:
                tally.answers.append((taken, 200 if replied else 500))
    return tally


def _ask(querier: zenoh.Querier, body: bytes) -> bool:
    """Whether there was a reply, and no error."""
    replies = list(querier.get(payload=body))
    return bool(replies) and replies[0].ok is not None


def _wait_for_answer(querier: zenoh.Querier, body: bytes) -> None:
    """A query finds nobody for a moment after the session has been opened."""
    until = time.monotonic() + _MEET_S
    while not _ask(querier, body):
        if time.monotonic() > until:
            raise RuntimeError("the service to measure does not answer over zenoh")
        time.sleep(0.02)
