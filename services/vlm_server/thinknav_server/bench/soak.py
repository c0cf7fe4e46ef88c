"""A long time of good and bad requests together: each is answered as it should be, and memory stays flat."""

import asyncio
import random
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from thinknav_server.bench.figures import Figure
from thinknav_server.bench.load import Connection
from thinknav_server.bench.memory import resident_mb
from thinknav_server.bench.mixed import Kind, kinds_of_requests
from thinknav_server.bench.servers import Setup, jpegs, our_service

SETUP = Setup(base=5.0, item=1.0, max_batch=16, max_wait=0.0, queue_size=64, cache_size=256)
ALLOWED_GROWTH = 0.05
_CLIENTS = 16
_PAUSE_S = 0.02  # of a client between two requests, on average: the machine is not to be the limit
_PATIENCE_S = 30.0
_SAMPLES = 60
# Allocators and caches fill first.
_WARM_UP_SHARE = 0.25


@dataclass
class Soaked:
    """answers: how often each kind of request was answered with each status. unanswered: kinds, with what went wrong.
    megabytes: of the server, from time to time.
    """

    answers: Counter[tuple[Kind, int]] = field(default_factory=Counter)
    unanswered: Counter[tuple[Kind, str]] = field(default_factory=Counter)
    megabytes: list[float] = field(default_factory=list)

    def growth(self) -> float:
        """How much memory grew from the first to the second half after warm-up, as a share. Raises ValueError for too
        few samples to tell.
        """
        warm = self.megabytes[int(len(self.megabytes) * _WARM_UP_SHARE) :]
        if len(warm) < 4:
            raise ValueError("too short to see memory grow; soak for longer")
        middle = len(warm) // 2
        return float(np.median(warm[middle:]) / np.median(warm[:middle]) - 1)

    def figures(self) -> Iterator[Figure]:
        """In numbers."""
        yield Figure("service.soak.requests", float(self.answers.total() + self.unanswered.total()), "requests")
        good = sum(count for (_, status), count in self.answers.items() if status == 200)
        yield Figure("service.soak.answered_ok", float(good), "requests")
        yield Figure("service.soak.unanswered", float(self.unanswered.total()), "requests")
        failed = sum(n for (kind, status), n in self.answers.items() if status >= 500 and status not in kind.statuses)
        yield Figure("service.soak.unasked_5xx", float(failed), "requests")
        yield Figure("service.soak.memory", self.megabytes[-1], "MB", "after a quarter", self._early())
        yield Figure("service.soak.memory_growth", self.growth(), "of the middle's, at the end")

    def complaints(self) -> list[str]:
        """What was not as it should be, a line each."""
        told = [
            f"{kind.name}: {count} answered with {status}"
            for (kind, status), count in self.answers.items()
            if status not in kind.statuses
        ]
        told += [f"{kind.name}: {count} unanswered ({why})" for (kind, why), count in self.unanswered.items()]
        if self.growth() > ALLOWED_GROWTH:
            told.append(f"memory grew by {self.growth():.1%} from middle to end")
        return told

    def _early(self) -> float:
        return self.megabytes[int(len(self.megabytes) * _WARM_UP_SHARE)]


def soak(seconds: float) -> Soaked:
    """Ask for so long."""
    with our_service(SETUP, quiet=True) as (url, pid):  # its log would tell of each failure that was asked for
        return asyncio.run(_ask_all(url, pid, kinds_of_requests(url, jpegs()), seconds))


async def _ask_all(url: str, pid: int, kinds: Sequence[Kind], seconds: float) -> Soaked:
    soaked = Soaked()
    until = time.monotonic() + seconds
    clients = [_client(url, kinds, until, soaked, random.Random(seed)) for seed in range(_CLIENTS)]
    await asyncio.gather(_weigh(pid, until, seconds / _SAMPLES, soaked), *clients)
    return soaked


async def _weigh(pid: int, until: float, pause: float, soaked: Soaked) -> None:
    while time.monotonic() < until:
        soaked.megabytes.append(resident_mb(pid))
        await asyncio.sleep(pause)


async def _client(url: str, kinds: Sequence[Kind], until: float, soaked: Soaked, chance: random.Random) -> None:
    """Keeps its connection as long as it asks what is right."""
    connection = await Connection.open(url)
    weights = [kind.weight for kind in kinds]
    while time.monotonic() < until:
        (kind,) = chance.choices(kinds, weights)
        request = chance.choice(kind.requests)
        try:
            async with asyncio.timeout(_PATIENCE_S):
                if kind.statuses:
                    _, status = await connection.ask(request)
                    soaked.answers[kind, status] += 1
                else:
                    await connection.send(request)
                    await asyncio.sleep(chance.uniform(0, 2 * _PAUSE_S))  # it may have begun on it
        except (TimeoutError, OSError, EOFError) as error:
            soaked.unanswered[kind, type(error).__name__] += 1
            connection.abort()
            connection = await Connection.open(url)
        else:
            if kind.hangs_up:
                connection.abort()
                connection = await Connection.open(url)
        await asyncio.sleep(chance.uniform(0, 2 * _PAUSE_S))
    connection.abort()
