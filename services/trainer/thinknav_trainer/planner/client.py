"""The planner as the trainer sees it: questions in, one answer or error for each, and nothing raised on the way.

Knows the contract and the service's limits; how bodies travel is the transport's concern.
"""

import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import (
    EMBEDDING_DIMENSION,
    EmbedRequest,
    Limits,
    PlannerError,
    PlannerInfo,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
)
from thinknav_trainer.planner.daemon_threads import DaemonThreads
from thinknav_trainer.planner.transport import Transport

Answer = SubgoalReply | PlannerError

# More bodies than this are not under way at once; the others wait for one of them.
MAX_OUTSTANDING = 256

# Requests that travel in one body where none should wait long for another's answer. A body costs as much as answering
# a request does; but one request that is never answered keeps the replies to all of its body until its deadline.
TOGETHER = 8

# Room in a body for all but the frames: ids, goals and the map around them.
_ENVELOPE_BYTES = 4096
_REQUEST_BYTES = 1024


@dataclass(frozen=True)
class Counts:
    """What became of the requests whose asking is done."""

    answered: int = 0
    failed: int = 0

    @property
    def asked(self) -> int:
        """All of them."""
        return self.answered + self.failed


class PlannerClient:
    """A planner that can be asked, from any number of threads. A context manager that closes its transport.

    Asks the service who it is first, and raises the PlannerError that prevents this.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._info = transport.info()
        self._counts = Counts()
        self._counting = threading.Lock()
        self._threads: DaemonThreads[list[Answer]] = DaemonThreads(MAX_OUTSTANDING, "planner-client")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def info(self) -> PlannerInfo:
        """Who answers, as told at the start."""
        return self._info

    @property
    def counts(self) -> Counts:
        """What was asked so far."""
        with self._counting:
            return self._counts

    def ask(self, requests: Sequence[SubgoalRequest]) -> list[Answer]:
        """One reply or error for each request, in their order. Blocks; never raises a PlannerError.

        The requests travel in as few bodies as the service's limits allow.
        """
        answers: list[Answer] = []
        for body in _bodies(requests, self._info.limits):
            answers += self._ask_body(body)
        failed = sum(isinstance(answer, PlannerError) for answer in answers)
        with self._counting:
            self._counts = Counts(self._counts.answered + len(answers) - failed, self._counts.failed + failed)
        return answers

    def submit(self, requests: Sequence[SubgoalRequest]) -> list[Future[Answer]]:
        """One future reply or error for each request, in their order. Does not block.

        A few travel together, so that none waits long for another's answer. Futures whose client is closed may never
        be done.
        """
        bodies = [requests[start : start + TOGETHER] for start in range(0, len(requests), TOGETHER)]
        return [
            future
            for body in bodies
            for future in _one_by_one(self._threads.submit(partial(self.ask, body)), len(body))
        ]

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """The embeddings (N, 512) float32 of N texts, in `info.embedding_space`. Raises PlannerError."""
        size = self._info.limits.max_texts
        parts = [self._embed_body(texts[start : start + size]) for start in range(0, len(texts), size)]
        return np.concatenate(parts) if parts else np.zeros((0, EMBEDDING_DIMENSION), np.float32)

    def close(self) -> None:
        """Close the transport. Nobody hears what is still under way."""
        self._threads.close()
        self._transport.close()

    def _ask_body(self, requests: Sequence[SubgoalRequest]) -> list[Answer]:
        try:
            answers = self._transport.ask(requests)
        except PlannerError as error:
            return [error.as_value()] * len(requests)
        if len(answers) != len(requests):
            mismatch = ProtocolMismatch(f"the service gave {len(answers)} answers to {len(requests)} requests")
            return [mismatch] * len(requests)
        return [self._checked(request, answer) for request, answer in zip(requests, answers, strict=True)]

    def _checked(self, request: SubgoalRequest, answer: Answer) -> Answer:
        """The answer, unless it is to something else or its embedding is of another space than was said."""
        if isinstance(answer, PlannerError):
            return answer
        if answer.request_id != request.request_id:
            return ProtocolMismatch(f"the service answered {answer.request_id[:64]!r} to {request.request_id!r}")
        if answer.embedding_space not in (None, self._info.embedding_space):
            return ProtocolMismatch(
                f"the service now embeds in {answer.embedding_space}, not in {self._info.embedding_space} as it said"
            )
        return answer

    def _embed_body(self, texts: Sequence[str]) -> NDArray[np.float32]:
        reply = self._transport.embed(EmbedRequest(texts=tuple(texts)))
        if reply.embedding_space != self._info.embedding_space:
            raise ProtocolMismatch(
                f"the service embeds in {reply.embedding_space}, not in {self._info.embedding_space} as it said"
            )
        if len(reply.embeddings) != len(texts):
            raise ProtocolMismatch(f"the service gave {len(reply.embeddings)} embeddings of {len(texts)} texts")
        return reply.embeddings


def _one_by_one(together: Future[list[Answer]], count: int) -> list[Future[Answer]]:
    """A future of each of so many answers, done when all of them are there."""
    each: list[Future[Answer]] = [Future() for _ in range(count)]

    def give(done: Future[list[Answer]]) -> None:
        if done.cancelled():
            return
        if (error := done.exception()) is not None:
            for future in each:
                future.set_exception(error)
            return
        for future, answer in zip(each, done.result(), strict=True):
            future.set_result(answer)

    together.add_done_callback(give)
    return each


def _bodies(requests: Sequence[SubgoalRequest], limits: Limits) -> Iterator[list[SubgoalRequest]]:
    """The requests in bodies within the limits; one that is too large by itself goes alone, to be refused."""
    body: list[SubgoalRequest] = []
    frames, size = 0, _ENVELOPE_BYTES
    for request in requests:
        more_frames = len(request.frames)
        more_bytes = sum(len(frame.data) for frame in request.frames) + 4 * len(request.goal) + _REQUEST_BYTES
        if body and (frames + more_frames > limits.max_frames or size + more_bytes > limits.max_body_bytes):
            yield body
            body, frames, size = [], 0, _ENVELOPE_BYTES
        body.append(request)
        frames += more_frames
        size += more_bytes
    if body:
        yield body
