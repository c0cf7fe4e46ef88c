"""A planner in a process of its own: one that hangs past its limit or dies is started again.

The requests that it was working on fail, and none is taken until it is back. Nothing here ever waits for the
planner to let go: a process that is not wanted is killed.
"""

import asyncio
import contextlib
import json
import logging
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import PlannerError, PlannerFailed, Unavailable, encode_requests
from thinknav_server.hosts.base import Identity
from thinknav_server.hosts.wire import (
    HEADER,
    Kind,
    message,
    pack_texts,
    unpack_embeddings,
    unpack_identity,
    unpack_thoughts,
)
from thinknav_server.logs import LogFormat, LogLevel
from thinknav_server.planners.options import PlannerOptions
from thinknav_server.thinking import Question, Thought

logger = logging.getLogger(__name__)

_LONGEST_PAUSE_S = 30.0
_STANDARD_ERROR = 2


@dataclass(frozen=True)
class ProcessSettings:
    """limit: seconds a batch may take. load_limit: seconds that loading may take. log: as the service's own."""

    limit: float = 120.0
    load_limit: float = 900.0
    log_level: LogLevel = LogLevel.INFO
    log_format: LogFormat = LogFormat.TEXT


class PlannerProcess:
    """Starts the process and loads the planner when it is made, and keeps it alive while it is open.

    Raises ValueError when the planner cannot be loaded. Close it even if it was never opened.
    """

    slots = 1
    ahead = 1
    batch_limit = None
    abandons = False

    def __init__(self, options: PlannerOptions, settings: ProcessSettings | None = None) -> None:
        self._settings = settings or ProcessSettings()
        boot = {
            "options": options.model_dump(mode="json"),
            "log_level": self._settings.log_level,
            "log_format": self._settings.log_format,
        }
        self._boot = json.dumps(boot).encode()
        self._child = _Child()
        try:
            self.identity = self._child.load(self._boot, self._settings.load_limit)
        except BaseException:
            self.close()
            raise
        self.restarts = 0
        self._calls: dict[int, _Call] = {}
        self._last_call = 0
        self._ready = False

    @property
    def ready(self) -> bool:
        return self._ready

    @property
    def pid(self) -> int:
        """Of the process that runs now; another one after a restart."""
        return self._child.process.pid

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._child.kill()
        self._child.end()

    async def __aenter__(self) -> Self:
        reader, self._writer = await asyncio.open_connection(sock=self._child.connection)
        self._turn, self._embedding = asyncio.Lock(), asyncio.Lock()
        self._embedder: asyncio.Task[NDArray[np.float32]] | None = None
        self._ready = True
        self._keeper = asyncio.create_task(self._keep_alive(reader), name="planner-process")
        return self

    async def __aexit__(self, *_: object) -> None:
        self._ready = False
        self._child.kill()  # and with it a thread that waits for it to load
        ending = [task for task in (self._keeper, self._embedder) if task is not None]
        for task in ending:
            task.cancel()
        await asyncio.gather(*ending, return_exceptions=True)
        await asyncio.to_thread(self.close)

    async def think(self, questions: Sequence[Question]) -> Sequence[Thought | PlannerError]:
        with self._ask(Kind.THINK, encode_requests([question.request for question in questions])) as call:
            async with self._turn:  # the process decodes it meanwhile
                thoughts = unpack_thoughts(await self._answer(call))
        if len(thoughts) != len(questions):
            raise PlannerFailed(f"the planner process gave {len(thoughts)} answers to {len(questions)} requests")
        return thoughts

    async def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """One after another: the process does no more at once, and the limit is for its work and not for a queue."""
        await self._embedding.acquire()
        self._embedder = asyncio.create_task(self._embed(texts), name="planner-embed")
        self._embedder.add_done_callback(self._embedded)
        return await asyncio.shield(self._embedder)  # the process goes on, though nobody may wait for it any more

    async def _embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        with self._ask(Kind.EMBED, pack_texts(texts)) as call:
            return unpack_embeddings(await self._answer(call), self.identity.dimension)

    def _embedded(self, task: "asyncio.Task[NDArray[np.float32]]") -> None:
        self._embedding.release()
        if not task.cancelled():
            task.exception()  # which nobody may have waited for

    @contextlib.contextmanager
    def _ask(self, kind: Kind, body: bytes) -> Iterator["_Call"]:
        if not self._ready:
            raise _being_started()
        self._last_call += 1
        number = self._last_call
        self._calls[number] = call = _Call(kind, asyncio.get_running_loop().create_future())
        self._writer.write(message(number, kind, body))
        try:
            yield call
        finally:
            del self._calls[number]
            if not call.answer.cancel() and not call.answer.cancelled():
                call.answer.exception()  # which nobody may have waited for

    async def _answer(self, call: "_Call") -> bytes:
        """What the process says, which may take as long as a batch may, from now on."""
        try:
            async with asyncio.timeout(self._settings.limit):
                return await call.answer
        except TimeoutError:
            reason = f"the planner took longer than its limit of {self._settings.limit:g} s, and is started again"
            logger.error(reason)
            self._lose(reason)
            raise PlannerFailed(reason) from None

    def _lose(self, reason: str) -> None:
        """Gives up the process and what was asked of it; the keeper sees its end and starts another."""
        self._ready = False
        self._child.kill()
        batches = [call for call in self._calls.values() if call.kind is Kind.THINK]
        for call in self._calls.values():
            if not call.answer.done():
                # It worked on the first batch alone: what was given to it ahead is not to blame.
                call.answer.set_exception(_being_started() if call in batches[1:] else PlannerFailed(reason))

    async def _keep_alive(self, reader: asyncio.StreamReader) -> None:
        while True:
            try:
                with contextlib.suppress(OSError, EOFError):
                    await self._listen(reader)
            finally:
                self._writer.close()
            surprised, self._ready = self._ready, False
            status = await asyncio.to_thread(self._child.end)
            if surprised:
                reason = f"the planner process ended ({status}), and is started again"
                logger.error(reason)
                self._lose(reason)
            await self._start_again()
            reader, self._writer = await asyncio.open_connection(sock=self._child.connection)
            self._ready = True

    async def _listen(self, reader: asyncio.StreamReader) -> None:
        """Hands out answers until the process ends."""
        while True:
            length, call, kind = HEADER.unpack(await reader.readexactly(HEADER.size))
            body = await reader.readexactly(length)
            if call not in self._calls or (answer := self._calls[call].answer).done():
                continue  # nobody waits for it any more
            if kind == Kind.FAILED:
                answer.set_exception(PlannerFailed(f"the planner process failed: {body.decode()}"))
            else:
                answer.set_result(body)

    async def _start_again(self) -> None:
        """Returns with another process that has loaded the planner, however long that takes."""
        pause = 0.0
        while True:
            await asyncio.sleep(pause)
            began = time.monotonic()
            try:
                self._child = _Child()
                identity = await asyncio.to_thread(self._child.load, self._boot, self._settings.load_limit)
            except (OSError, ValueError) as error:  # the machine may have no room for another process yet
                problem = str(error)
            else:
                if identity == self.identity:
                    break
                problem = f"{identity} came back in the place of {self.identity}; restart the service to serve it"
            await asyncio.to_thread(self.close)
            pause = min(max(2 * pause, 1.0), _LONGEST_PAUSE_S)
            logger.error("the planner cannot be started again, next attempt in %g s: %s", pause, problem)
        self.restarts += 1
        logger.warning("the planner is back after %.1f s", time.monotonic() - began)


@dataclass(eq=False)
class _Call:
    kind: Kind
    answer: asyncio.Future[bytes]


def _being_started() -> Unavailable:
    return Unavailable("the planner is being started again; try again in a while")


class _Child:
    """One process, and our end of the socket to it."""

    def __init__(self) -> None:
        self.connection, theirs = socket.socketpair()
        with theirs, contextlib.ExitStack() as undo:
            undo.callback(self.connection.close)
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "thinknav_server.hosts.child", str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=_STANDARD_ERROR,  # what the service writes to its own standard output is read by programs
            )
            undo.pop_all()

    def load(self, boot: bytes, limit: float) -> Identity:
        """Who was loaded, after at most `limit` seconds. Raises ValueError."""
        self.connection.settimeout(limit)
        try:
            self.connection.sendall(message(0, Kind.LOAD, boot))
            length, _, kind = HEADER.unpack(self._read(HEADER.size))
            body = self._read(length)
        except TimeoutError:
            raise ValueError(f"the planner was not loaded within {limit:g} s") from None
        except OSError:
            raise ValueError(f"the planner process ended while it loaded ({self.end()}); the log says why") from None
        if kind == Kind.REFUSED:
            raise ValueError(body.decode())
        return unpack_identity(body)

    def kill(self) -> None:
        """Begin its end, and wake whoever reads from it; may be called again."""
        self.process.kill()
        with contextlib.suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)

    def end(self) -> str:
        """How it ended; waits, but not for long: it ends by itself when its socket does."""
        try:
            status = self.process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            status = self.process.wait()
        self.connection.close()
        return f"killed by {signal.Signals(-status).name}" if status < 0 else f"status {status}"

    def _read(self, length: int) -> bytes:
        content = b""
        while len(content) < length:
            part = self.connection.recv(length - len(content))
            if not part:
                raise ConnectionResetError
            content += part
        return content
