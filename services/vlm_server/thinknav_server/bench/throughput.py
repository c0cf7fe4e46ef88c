"""Subgoals a second at several numbers of clients, beside LitServe's and the model's own; what a lone request costs.

What is compared is measured in turns, and a ratio is the median of the turns' ratios. The load generator runs on the
same processors: what it takes of them is told as well, and the processor time of a subgoal, which other work on the
machine changes little.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import Frame, SubgoalRequest
from thinknav_server.bench.figures import Figure
from thinknav_server.bench.load import Tally, closed_loop
from thinknav_server.bench.planner import EmulatedPlanner
from thinknav_server.bench.processor import processor_seconds
from thinknav_server.bench.servers import (
    Setup,
    check_each_was_planned,
    free_port,
    frozen,
    jpegs,
    litserve,
    litserve_requests,
    our_bodies,
    our_requests,
    our_service,
)
from thinknav_server.bench.turns import in_turns, median
from thinknav_server.bench.zenoh_load import lone_loop
from thinknav_server.images import PixelMemory
from thinknav_server.planners import PlanItem
from thinknav_server.thinking import Thinker, decoded_batch

CLIENTS = (1, 16, 64, 256)
# A model so quick that the server is what is measured, and one as slow as a small VLM on a GPU.
QUICK = Setup(base=2.0, item=0.05)
SLOW = Setup(base=20.0, item=2.0)
_MAKE_PEER = "litserve, not measured: make bench-server-peers"

Measurement = Callable[[float], float]


@dataclass(frozen=True)
class Server:
    """One to be asked. requests: whole, for it."""

    url: str
    pid: int
    requests: Sequence[bytes]


@dataclass(frozen=True)
class Asked:
    """What came of asking a server, and the seconds of processor time that it and the load generator took."""

    tally: Tally
    server: float
    generator: float

    def rate(self) -> float:
        """Subgoals a second."""
        return self.tally.rate()

    def p99(self) -> float:
        """Milliseconds."""
        return self.tally.quantile(0.99)

    def processor(self) -> float:
        """Milliseconds of the server's processor time for each subgoal."""
        return 1000 * self.server / self.tally.sent

    def generator_share(self) -> float:
        """Of all processor time taken."""
        return self.generator / (self.generator + self.server)


def throughput_figures(peer: Path, seconds: float) -> Iterator[Figure]:
    """Each as soon as it is measured. peer: LitServe's virtual environment. seconds: of each measurement, in turns."""
    frames = jpegs()
    python = peer / "bin" / "python"
    with ExitStack() as running:
        url, pid = running.enter_context(our_service(QUICK))
        ours = Server(url, pid, our_requests(url, frames))
        asked = [partial(_ask, ours)]
        if python.exists():
            url, pid = running.enter_context(litserve(python, QUICK))
            theirs = Server(url, pid, litserve_requests(url, frames))
            asked = [partial(_ask_beside, theirs, ours), partial(_ask, theirs)]
        for clients in CLIENTS:
            turns = in_turns([partial(ask, clients) for ask in asked], seconds)
            yield from compared(clients, *zip(*turns, strict=True))
        check_each_was_planned(ours.url)
    yield _beside_the_model(frames, seconds)
    yield from _alone(frames, seconds)


def _ask(server: Server, clients: int, seconds: float) -> Asked:
    server_before, generator_before = processor_seconds(server.pid), time.process_time()
    tally = closed_loop(server.url, server.requests, clients, seconds)
    return Asked(tally, processor_seconds(server.pid) - server_before, time.process_time() - generator_before)


def _ask_beside(peer: Server, server: Server, clients: int, seconds: float) -> Asked:
    """LitServe's workers take a seventh of a processor when nobody asks them anything; ours take none."""
    with frozen(peer.pid):
        return _ask(server, clients, seconds)


def compared(clients: int, ours: Sequence[Asked], theirs: Sequence[Asked] | None = None) -> Iterator[Figure]:
    """What came of the turns of each."""

    def figure(name: str, unit: str, of: Callable[[Asked], float], more_is_better: bool) -> Figure:
        value = median([of(asked) for asked in ours])
        if theirs is None:
            return Figure(name, value, unit, _MAKE_PEER)
        ratios = [of(our) / of(their) for our, their in zip(ours, theirs, strict=True)]
        ratio = median([ratio if more_is_better else 1 / ratio for ratio in ratios])
        return Figure(name, value, unit, "litserve", median([of(asked) for asked in theirs]), ratio)

    name = f"service.c{clients}"
    yield figure(f"{name}.vs_litserve", "subgoals/s", Asked.rate, more_is_better=True)
    yield figure(f"{name}.p99", "ms", Asked.p99, more_is_better=False)
    yield figure(f"{name}.processor", "ms of processor time a subgoal", Asked.processor, more_is_better=False)
    share = median([asked.generator_share() for asked in ours])
    yield Figure(f"{name}.generator_share", share, "of all processor time taken, by the load generator")


def _beside_the_model(frames: list[bytes], seconds: float) -> Figure:
    """Two full batches are asked for at any time, so that one can be worked on while the other comes and goes."""
    planner = EmulatedPlanner(str(SLOW.base), str(SLOW.item))
    items = [
        item
        for item in decoded_batch(_requests(frames, SLOW.max_batch), PixelMemory()).items
        if isinstance(item, PlanItem)
    ]
    with our_service(SLOW) as (url, pid):
        server = Server(url, pid, our_requests(url, frames))

        def served(seconds: float) -> float:
            return _ask(server, 2 * SLOW.max_batch, seconds).rate()

        measurements: list[Measurement] = [partial(_offline_rate, planner, items), served]
        turns = in_turns(measurements, seconds)
        check_each_was_planned(url)
    share = median([served / offline for offline, served in turns])
    return Figure("service.offline_share", share, "of the model's own throughput, in full batches of decoded frames")


def _alone(frames: list[bytes], seconds: float) -> Iterator[Figure]:
    setup = replace(SLOW, max_wait=0.0)
    thinker = Thinker(EmulatedPlanner(str(setup.base), str(setup.item)), shipped_text_encoder())
    place = f"127.0.0.1:{free_port()}"
    with our_service(setup, "--zenoh", place, "--replica", "measured") as (url, _):
        requests, bodies = our_requests(url, frames), our_bodies(frames)

        def over_http(seconds: float) -> float:
            return closed_loop(url, requests, 1, seconds).quantile(0.5)

        def over_zenoh(seconds: float) -> float:
            return lone_loop(place, "measured", bodies, seconds).quantile(0.5)

        measurements: list[Measurement] = [partial(_offline_latency, thinker, frames), over_http, over_zenoh]
        turns = in_turns(measurements, seconds)
        check_each_was_planned(url)
    unit = "ms above the model and the decoding of a frame, for a lone request"
    yield Figure("service.http.added_ms", median([http - alone for alone, http, _ in turns]), unit)
    yield Figure("service.zenoh.added_ms", median([zenoh - alone for alone, _, zenoh in turns]), unit)


def _requests(frames: list[bytes], count: int) -> list[SubgoalRequest]:
    return [
        SubgoalRequest(request_id=str(index), goal="chair", frame=Frame(encoding="jpeg", data=data))
        for index, data in enumerate(frames[:count])
    ]


def _offline_rate(planner: EmulatedPlanner, items: Sequence[PlanItem], seconds: float) -> float:
    """Subgoals a second that the model gives when all that it is asked lies ready."""
    began = time.perf_counter()
    batches = 0
    while (elapsed := time.perf_counter() - began) < seconds or not batches:
        planner.plan(items)
        batches += 1
    return batches * len(items) / elapsed


def _offline_latency(thinker: Thinker, frames: list[bytes], seconds: float) -> float:
    """Median milliseconds of one frame: decoded, planned and embedded without a service."""
    requests = _requests(frames, len(frames))
    taken: list[float] = []
    until = time.perf_counter() + seconds
    while (began := time.perf_counter()) < until:
        thinker.think([requests[len(taken) % len(requests)]])
        taken.append(time.perf_counter() - began)
    return 1000 * float(np.median(taken))
