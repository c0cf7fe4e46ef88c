"""A load generator that costs little itself: whole HTTP requests are made beforehand, and answers are barely read."""

import asyncio
import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import numpy as np

_FEWEST = 10


@dataclass
class Tally:
    """(seconds, status) of each request, and the seconds that all took together.

    sent: how many there were in all, those of the warm-up included.
    """

    answers: list[tuple[float, int]] = field(default_factory=list)
    seconds: float = 0.0
    sent: int = 0

    def latencies(self, status: int = 200) -> list[float]:
        """Seconds of the requests answered with a status."""
        return [seconds for seconds, answered in self.answers if answered == status]

    def rate(self, status: int = 200) -> float:
        """Requests a second answered with a status. Raises ValueError when there were too few to tell."""
        return len(self._enough(status)) / self.seconds

    def quantile(self, share: float, status: int = 200) -> float:
        """Milliseconds within which a share of them was answered. Raises ValueError when there were too few to tell."""
        return 1000 * float(np.quantile(self._enough(status), share))

    def _enough(self, status: int) -> list[float]:
        latencies = self.latencies(status)
        if len(latencies) < _FEWEST:
            raise ValueError(
                f"{len(latencies)} requests were answered with {status} in {self.seconds:g} s, which is too few to "
                "tell anything; measure for longer, or when the machine has less to do"
            )
        return latencies


def http_request(url: str, path: str, kind: str, body: bytes) -> bytes:
    """A whole POST."""
    head = f"POST {path} HTTP/1.1\r\nHost: {urlsplit(url).netloc}\r\nContent-Type: {kind}\r\n"
    return f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body


def closed_loop(url: str, requests: Sequence[bytes], clients: int, seconds: float) -> Tally:
    """Each client asks again as soon as it is answered. The first second, or fifth part, is not counted."""
    return asyncio.run(_closed_loop(url, requests, clients, seconds))


def open_loop(url: str, requests: Sequence[bytes], rate: float, seconds: float) -> Tally:
    """`rate` requests a second, whether or not the earlier ones are answered."""
    return asyncio.run(_open_loop(url, requests, rate, seconds))


async def _closed_loop(url: str, requests: Sequence[bytes], clients: int, seconds: float) -> Tally:
    tally = Tally()
    turns = itertools.cycle(requests)
    warm = min(1.0, seconds / 5)
    began = time.perf_counter() + warm
    until = began + seconds

    async def client() -> None:
        connection = await Connection.open(url)
        while time.perf_counter() < until:
            answer = await connection.ask(next(turns))
            tally.sent += 1
            if began <= time.perf_counter() < until:
                tally.answers.append(answer)
        await connection.close()

    await asyncio.gather(*(client() for _ in range(clients)))
    tally.seconds = seconds
    return tally


async def _open_loop(url: str, requests: Sequence[bytes], rate: float, seconds: float) -> Tally:
    tally = Tally(seconds=seconds)
    turns: Iterator[bytes] = itertools.cycle(requests)
    idle: list[Connection] = []
    asking: set[asyncio.Task[None]] = set()

    async def ask() -> None:
        connection = idle.pop() if idle else await Connection.open(url)
        tally.sent += 1
        tally.answers.append(await connection.ask(next(turns)))
        idle.append(connection)

    began = time.perf_counter()
    sent = 0
    while (elapsed := time.perf_counter() - began) < seconds:
        for _ in range(int(elapsed * rate) - sent):
            task = asyncio.create_task(ask())
            asking.add(task)
            task.add_done_callback(asking.discard)
            sent += 1
        await asyncio.sleep(0.002)
    await asyncio.gather(*asking)
    for connection in idle:
        await connection.close()
    return tally


class Connection:
    """One connection that is kept alive."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    @classmethod
    async def open(cls, url: str) -> "Connection":
        address = urlsplit(url)
        return cls(*await asyncio.open_connection(address.hostname, address.port))

    async def ask(self, request: bytes) -> tuple[float, int]:
        """Seconds, and the status of the answer."""
        began = time.perf_counter()
        self._writer.write(request)
        head = (await self._reader.readuntil(b"\r\n\r\n")).lower()
        length = int(head.partition(b"content-length:")[2].partition(b"\r\n")[0])
        await self._reader.readexactly(length)
        return time.perf_counter() - began, int(head.split(b" ", 2)[1])

    async def send(self, request: bytes) -> None:
        """A request, or a part of one, whose answer nobody waits for."""
        self._writer.write(request)
        await self._writer.drain()

    def abort(self) -> None:
        """Hang up, whatever is on its way."""
        self._writer.transport.abort()

    async def close(self) -> None:
        self._writer.close()
        await self._writer.wait_closed()
