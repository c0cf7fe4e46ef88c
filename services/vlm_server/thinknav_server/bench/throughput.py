"""Subgoals a second at several numbers of clients, beside LitServe's and the model's own; what a lone request costs."""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import Frame, SubgoalRequest
from thinknav_server.bench.figures import Figure
from thinknav_server.bench.load import Tally, closed_loop
from thinknav_server.bench.planner import EmulatedPlanner
from thinknav_server.bench.servers import (
    Setup,
    free_port,
    jpegs,
    litserve,
    litserve_requests,
    our_bodies,
    our_requests,
    our_service,
)
from thinknav_server.bench.zenoh_load import lone_loop
from thinknav_server.thinking import Thinker

CLIENTS = (1, 16, 64, 256)
# A model so quick that the server is what is measured, and one as slow as a small VLM on a GPU.
QUICK = Setup(base=2.0, item=0.05)
SLOW = Setup(base=20.0, item=2.0)
_MAKE_PEER = "litserve, not measured: make bench-server-peers"


def throughput_figures(peer: Path, seconds: float) -> Iterator[Figure]:
    """Each as soon as it is measured. peer: LitServe's virtual environment. seconds: of each measurement."""
    frames = jpegs()
    python = peer / "bin" / "python"
    theirs: dict[int, Tally] = {}
    with our_service(QUICK) as (url, _):
        requests = our_requests(url, frames)
        ours = {clients: closed_loop(url, requests, clients, seconds) for clients in CLIENTS}
    if python.exists():
        with litserve(python, QUICK) as url:
            requests = litserve_requests(url, frames)
            theirs = {clients: closed_loop(url, requests, clients, seconds) for clients in CLIENTS}
    for clients in CLIENTS:
        yield from _compared(clients, ours[clients], theirs.get(clients))
    yield from _beside_the_model(frames, seconds)


def _compared(clients: int, ours: Tally, theirs: Tally | None) -> Iterator[Figure]:
    name = f"service.c{clients}"
    if theirs is None:
        yield Figure(f"{name}.vs_litserve", ours.rate(), "subgoals/s", _MAKE_PEER)
        yield Figure(f"{name}.p99", ours.quantile(0.99), "ms")
        return
    ratio = ours.rate() / theirs.rate()
    yield Figure(f"{name}.vs_litserve", ours.rate(), "subgoals/s", "litserve", theirs.rate(), ratio)
    slower = theirs.quantile(0.99)
    yield Figure(f"{name}.p99", ours.quantile(0.99), "ms", "litserve", slower, slower / ours.quantile(0.99))


def _beside_the_model(frames: list[bytes], seconds: float) -> Iterator[Figure]:
    offline = _offline_rate(frames, SLOW, seconds)
    with our_service(SLOW) as (url, _):
        served = closed_loop(url, our_requests(url, frames), 2 * SLOW.max_batch, seconds)
    yield Figure("service.offline_share", served.rate() / offline, "of the model's own throughput in full batches")
    lone = replace(SLOW, max_wait=0.0)
    alone = _offline_latency(frames, lone, seconds)
    place = f"127.0.0.1:{free_port()}"
    with our_service(lone, "--zenoh", place, "--replica", "measured") as (url, _):
        over_http = closed_loop(url, our_requests(url, frames), 1, seconds)
        over_zenoh = lone_loop(place, "measured", our_bodies(frames), seconds)
    unit = "ms above the model, for a lone request"
    yield Figure("service.http.added_ms", over_http.quantile(0.5) - alone, unit)
    yield Figure("service.zenoh.added_ms", over_zenoh.quantile(0.5) - alone, unit)


def _thinker(setup: Setup) -> Thinker:
    return Thinker(EmulatedPlanner(str(setup.base), str(setup.item)), shipped_text_encoder())


def _requests(frames: list[bytes], count: int) -> list[SubgoalRequest]:
    return [
        SubgoalRequest(request_id=str(index), goal="chair", frame=Frame(encoding="jpeg", data=data))
        for index, data in enumerate(frames[:count])
    ]


def _offline_rate(frames: list[bytes], setup: Setup, seconds: float) -> float:
    """Subgoals a second that the model gives in full batches, the frames decoded in the same process."""
    thinker, batch = _thinker(setup), _requests(frames, setup.max_batch)
    began = time.perf_counter()
    batches = 0
    while (elapsed := time.perf_counter() - began) < seconds:
        thinker.think(batch)
        batches += 1
    return batches * setup.max_batch / elapsed


def _offline_latency(frames: list[bytes], setup: Setup, seconds: float) -> float:
    """Median milliseconds of one frame, without a service."""
    thinker, batch = _thinker(setup), _requests(frames, 1)
    taken = []
    until = time.perf_counter() + seconds
    while (began := time.perf_counter()) < until:
        thinker.think(batch)
        taken.append(time.perf_counter() - began)
    return 1000 * float(np.median(taken))
