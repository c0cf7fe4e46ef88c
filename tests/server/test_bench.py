"""The load generator and the figures; the measurements themselves are not for a test."""

import asyncio
import json
import os
import subprocess
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from thinknav_proto import decode_requests
from thinknav_server.bench.figures import Figure
from thinknav_server.bench.load import Connection, Tally, closed_loop, http_request, open_loop
from thinknav_server.bench.memory import resident_mb
from thinknav_server.bench.mixed import Kind, kinds_of_requests
from thinknav_server.bench.model import Emulated
from thinknav_server.bench.planner import EmulatedPlanner
from thinknav_server.bench.processor import processor_seconds
from thinknav_server.bench.servers import (
    check_each_was_planned,
    free_port,
    frozen,
    jpegs,
    litserve_requests,
    our_bodies,
    our_requests,
    our_service,
)
from thinknav_server.bench.soak import SETUP, Soaked
from thinknav_server.bench.throughput import Asked, compared
from thinknav_server.bench.turns import in_turns
from thinknav_server.bench.zenoh_load import lone_loop

URL = "http://127.0.0.1:8765"


class TinyServer(ThreadingHTTPServer):
    """Answers every second request with 429."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), TinyHandler)
        self.bodies: list[bytes] = []
        self.url = f"http://127.0.0.1:{self.server_port}"


class TinyHandler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_POST(self) -> None:
        assert isinstance(self.server, TinyServer)
        self.server.bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(200 if len(self.server.bodies) % 2 else 429)
        self.send_header("Content-Length", "2")
        self.end_headers()
        self.wfile.write(b"ok")

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server() -> Iterator[TinyServer]:
    with TinyServer() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def test_clients_ask_again_when_they_are_answered(server: TinyServer) -> None:
    requests = [http_request(server.url, "/", "text/plain", body) for body in (b"one", b"two")]
    tally = closed_loop(server.url, requests, clients=3, seconds=0.5)
    assert set(server.bodies) == {b"one", b"two"}
    assert {status for _, status in tally.answers} == {200, 429}
    assert len(tally.answers) <= len(server.bodies)
    assert tally.rate() == pytest.approx(len(tally.latencies()) / 0.5)
    assert 0 < tally.quantile(0.5) <= tally.quantile(0.99)


def test_a_rate_is_kept_whether_or_not_answers_come(server: TinyServer) -> None:
    requests = [http_request(server.url, "/", "text/plain", b"one")]
    tally = open_loop(server.url, requests, rate=100, seconds=0.5)
    assert 40 <= len(tally.answers) <= 50
    assert len(server.bodies) == len(tally.answers)


def test_too_few_answers_say_so() -> None:
    with pytest.raises(ValueError, match=r"1 requests were answered with 200 in 2 s, .* measure for longer"):
        Tally([(0.1, 200), (0.1, 429)], 2.0).rate()


def test_a_figure_is_a_line_of_json_with_three_digits() -> None:
    line = Figure("service.c64.vs_litserve", 1234.56, "subgoals/s", "litserve", 600.0, 2.0576).line
    assert json.loads(line) == {
        "figure": "service.c64.vs_litserve",
        "value": 1230.0,
        "unit": "subgoals/s",
        "peer": "litserve",
        "peer_value": 600.0,
        "ratio": 2.06,
    }


def test_both_servers_are_sent_the_same_frames() -> None:
    frames = jpegs()
    assert len(set(frames)) == len(frames)
    frames = frames[:3]
    ours, theirs = our_requests(URL, frames), litserve_requests(URL, frames)
    (request,) = decode_requests(ours[1].partition(b"\r\n\r\n")[2])
    assert getattr(request, "frame").data == frames[1]  # noqa: B009
    assert json.loads(theirs[1].partition(b"\r\n\r\n")[2])["goal"] == "chair"


def test_the_emulated_model_answers_each() -> None:
    assert len(Emulated(0, 0)(5)) == 5
    assert EmulatedPlanner("0", "0").identity.revision == "0-0"
    assert EmulatedPlanner("0", "0").plan([]) == []


def test_each_kind_of_request_is_answered_as_the_soak_expects() -> None:
    async def ask(url: str, kind: Kind) -> int:
        connection = await Connection.open(url)
        _, status = await connection.ask(kind.requests[0])
        connection.abort()
        return status

    place = f"127.0.0.1:{free_port()}"
    with our_service(SETUP, "--zenoh", place, "--replica", "r", quiet=True) as (url, pid):
        frames = jpegs()
        before = processor_seconds(pid)
        check_each_was_planned(url)
        kinds = [kind for kind in kinds_of_requests(url, frames[:80]) if kind.statuses]
        answers = {kind.name: asyncio.run(ask(url, kind)) for kind in kinds}
        assert resident_mb(pid) > 50
        with pytest.raises(RuntimeError, match="not asked for all that was answered"):
            check_each_was_planned(url)  # one of these frames came twice
        assert processor_seconds(pid) > before > 0
        with frozen(pid):
            while Path(f"/proc/{pid}/stat").read_text().split()[2] != "T":  # it may be on its way out of a call
                time.sleep(0.01)
        assert lone_loop(place, "r", our_bodies(frames[:2]), 0.2).latencies()
    assert {kind.name: answers[kind.name] in kind.statuses for kind in kinds} == dict.fromkeys(answers, True)
    assert answers["one that breaks the planner"] == 502
    assert answers["a bomb"] == answers["a body that is too long"] == 400


def test_the_memory_of_children_counts() -> None:
    alone = resident_mb(os.getpid())
    child = subprocess.Popen(
        ["python3", "-c", "held = b'x' * 50_000_000; print(1, flush=True); input()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout
    child.stdout.readline()
    assert resident_mb(os.getpid()) > alone + 40
    child.communicate("")
    assert resident_mb(child.pid) == 0


def test_a_soak_complains_of_what_is_wrong_and_of_nothing_else() -> None:
    good, slow = Kind("good", [], frozenset({200})), Kind("slow", [], frozenset({504}))
    soaked = Soaked(megabytes=[10.0, 100.0, 100.0, 100.0, 100.0, 101.0])
    soaked.answers.update({(good, 200): 5, (slow, 504): 2})
    assert soaked.complaints() == []
    soaked.answers[good, 500] += 1
    soaked.unanswered[slow, "TimeoutError"] += 1
    soaked.megabytes += 4 * [120.0]
    told = soaked.complaints()
    assert told[:2] == ["good: 1 answered with 500", "slow: 1 unanswered (TimeoutError)"]
    assert "memory grew" in told[2]
    values = {figure.figure: figure.value for figure in soaked.figures()}
    assert values["service.soak.unasked_5xx"] == values["service.soak.unanswered"] == 1
    with pytest.raises(ValueError, match="soak for longer"):
        Soaked(megabytes=[1.0]).growth()


def asked(rate: int, milliseconds: float, server: float, generator: float) -> Asked:
    return Asked(Tally(rate * [(milliseconds / 1000, 200)], 1.0, sent=2 * rate), server, generator)


def test_a_comparison_is_the_median_of_neighbours_and_can_go_either_way() -> None:
    ours = [asked(200, 10, 0.4, 0.1), asked(20, 100, 0.4, 0.1), asked(100, 20, 0.4, 0.1)]
    theirs = [asked(100, 20, 0.4, 0.1), asked(10, 200, 0.4, 0.1), asked(100, 20, 0.4, 0.1)]
    rate, p99, processor, share = compared(64, ours, theirs)
    assert (rate.figure, rate.value, rate.peer_value, rate.ratio) == ("service.c64.vs_litserve", 100, 100, 2.0)
    assert p99.figure == "service.c64.p99"
    assert [p99.value, p99.ratio] == pytest.approx([20, 2])
    assert [processor.value, processor.ratio] == pytest.approx([2, 2])  # ms, of 200 requests in 0.4 s
    assert share.value == pytest.approx(0.2)
    worse = {figure.figure: figure.ratio for figure in compared(64, theirs, ours)}
    assert worse["service.c64.vs_litserve"] == worse["service.c64.p99"] == pytest.approx(0.5)
    assert worse["service.c64.processor"] == pytest.approx(0.5)
    alone = list(compared(64, ours))
    assert alone[0].ratio is None
    assert "make bench-server-peers" in str(alone[0].peer)


def test_turns_go_back_and_forth() -> None:
    order: list[str] = []

    def measure(name: str, seconds: float) -> float:
        order.append(name)
        return seconds

    turns = in_turns([lambda seconds: measure("a", seconds), lambda seconds: measure("b", -seconds)], 10.0)
    assert turns == 5 * [(2.0, -2.0)]
    assert "".join(order) == "abbaabbaab"
