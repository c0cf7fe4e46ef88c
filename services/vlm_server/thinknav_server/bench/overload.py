"""Ten times more requests than the service can answer: what becomes of those it admits, and of the others."""

import threading
import time
from collections.abc import Iterator

from thinknav_server.bench.figures import Figure
from thinknav_server.bench.load import closed_loop, open_loop
from thinknav_server.bench.memory import resident_mb
from thinknav_server.bench.servers import Setup, jpegs, our_requests, our_service

# Answers 100 subgoals a second, so that ten times as many can be sent from the same machine. The queue holds one batch:
# who is admitted waits for the batch before his, as in quiet times.
SETUP = Setup(base=40.0, item=5.0, max_batch=8, max_wait=0.0, queue_size=8)
_FACTOR = 10
_QUIET_S = 10.0
_TOO_MANY = 429


def overload_figures(seconds: float) -> Iterator[Figure]:
    """seconds: of overload."""
    frames = jpegs()
    with our_service(SETUP) as (url, pid):
        requests = our_requests(url, frames)
        quiet = closed_loop(url, requests, 2 * SETUP.max_batch, min(_QUIET_S, seconds))
        yield Figure("service.quiet.p99", quiet.quantile(0.99), "ms")
        early: list[float] = []
        look = threading.Timer(seconds / 4, lambda: early.append(resident_mb(pid)))
        look.start()
        crowded = open_loop(url, requests, _FACTOR * quiet.rate(), seconds)
        ended = time.perf_counter()
        late = resident_mb(pid)
        look.join()
        recovered = _until_as_before(url, requests, quiet.quantile(0.5)) - ended
        admitted = crowded.quantile(0.99)
        yield Figure("service.overload.offered", len(crowded.answers) / seconds, "requests/s")
        yield Figure("service.overload.answered", crowded.rate(), "subgoals/s", "quiet", quiet.rate())
        usual = quiet.quantile(0.99)
        yield Figure("service.overload.admitted_p99", admitted, "ms", "quiet", usual, usual / admitted)
        yield Figure("service.overload.refused_p99", crowded.quantile(0.99, _TOO_MANY), "ms until 429")
        others = sum(status not in (200, _TOO_MANY) for _, status in crowded.answers)
        yield Figure("service.overload.neither", float(others), "requests")
        yield Figure("service.overload.memory", late, "MB", "after a quarter of it", early[0], early[0] / late)
        yield Figure("service.overload.recovery", recovered, "s")


def _until_as_before(url: str, requests: list[bytes], usual_ms: float) -> float:
    """When a lone request is answered within the usual time again."""
    while True:
        tally = closed_loop(url, requests, 1, 0.2)
        seconds = tally.latencies()
        if seconds and 1000 * min(seconds) <= usual_ms:
            return time.perf_counter()
