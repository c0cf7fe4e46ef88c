"""The planning service, told from a request to its reply: admit, remember, batch, think, answer.

Knows nothing of HTTP or any other door; they all call `answer_each`, `embed` and `info`. Where thinking is done
is the host's concern.
"""

import asyncio
import time
from collections.abc import Sequence
from typing import Self

from thinknav_proto import (
    EMBEDDING_DIMENSION,
    PROTOCOL_VERSION,
    EmbedReply,
    EmbedRequest,
    Overloaded,
    PlannerError,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
    Timings,
    Unavailable,
)
from thinknav_server.batcher import Batcher
from thinknav_server.caller import ANONYMOUS, Caller
from thinknav_server.hosts import Host
from thinknav_server.limits import admit, admit_texts, check_frame_count
from thinknav_server.metrics import Metrics
from thinknav_server.recent import Recent
from thinknav_server.reply_cache import ReplyCache, question_key
from thinknav_server.request_log import log_answers
from thinknav_server.settings import Settings
from thinknav_server.status_page import Status
from thinknav_server.thinking import Question, Thought


class PlanningService:
    """Answers requests for subgoals while it is open as an async context manager."""

    def __init__(self, host: Host, settings: Settings) -> None:
        who = host.identity
        if who.dimension != EMBEDDING_DIMENSION:
            raise ValueError(
                f"the text encoder {who.space} gives embeddings of {who.dimension} values, "
                f"the protocol carries {EMBEDDING_DIMENSION}"
            )
        self.info = PlannerInfo(
            protocol_version=PROTOCOL_VERSION,
            planner=who.planner.name,
            revision=who.planner.revision,
            prompt_hash=who.planner.prompt_hash,
            embedding_space=str(who.space),
            limits=settings.limits,
        )
        self.metrics = Metrics()
        self.recent = Recent(settings.show_frames)
        self._settings = settings
        self._host = host
        self._cache = ReplyCache(settings.cache_size)
        self._batcher: Batcher[Question, Thought] = Batcher(
            host.think,
            max_batch=min(settings.max_batch, host.batch_limit or settings.max_batch),
            max_wait=settings.max_wait,
            queue_size=settings.queue_size,
            slots=host.slots,
            ahead=host.ahead,
            abandons=host.abandons,
            on_batch=self._on_batch,
        )
        self._in_flight = 0
        self._embedding = 0  # requests for embeddings
        self._idle = asyncio.Event()
        self._idle.set()
        self._draining = False
        self._expose()

    async def __aenter__(self) -> Self:
        await self._host.__aenter__()
        await self._batcher.__aenter__()
        return self

    async def __aexit__(self, *error: object) -> None:
        await self._batcher.__aexit__(*error)
        await self._host.__aexit__(*error)

    def introduce(self) -> PlannerInfo:
        """Who answers, told while requests are answered. Raises Unavailable at other times."""
        self._check_ready()
        return self.info

    @property
    def ready(self) -> bool:
        """Whether requests are answered now."""
        return self._batcher.running and self._host.ready and not self._draining

    @property
    def status(self) -> Status:
        """What people are told of the service now."""
        return Status(
            info=self.info,
            ready=self.ready,
            waiting=self._batcher.waiting,
            in_flight=self._in_flight,
            cached=len(self._cache),
            restarts=self._host.restarts,
            queue_size=self._settings.queue_size,
        )

    async def drain(self, grace: float) -> None:
        """From now on refuse new requests; returns when those in flight are answered, or after `grace` seconds."""
        self._draining = True
        try:
            await asyncio.wait_for(self._idle.wait(), grace)
        except TimeoutError:
            return

    async def answer(self, request: SubgoalRequest, caller: Caller = ANONYMOUS) -> SubgoalReply:
        """The subgoal for one request. Raises the PlannerError that stood in its way."""
        admit(request, self.info.limits)
        self._check_ready()
        key = question_key(request)
        remembered = self._cache.get(key)
        if remembered is not None:
            self.metrics.saved("cache")
            return self._reply(request, remembered, Timings(queued=0.0, planned=0.0, embedded=0.0))
        batched = await self._batcher.submit(Question(request, caller.trace), request.deadline, caller.name, key)
        if batched.shared:
            self.metrics.saved("shared")
        thought = batched.result
        timings = Timings(queued=max(0.0, batched.queued), planned=thought.planned, embedded=thought.embedded)
        reply = self._reply(request, thought, timings)
        self._cache.put(key, thought)
        return reply

    async def answer_each(
        self, requests: Sequence[SubgoalRequest | PlannerError], caller: Caller = ANONYMOUS
    ) -> list[SubgoalReply | PlannerError]:
        """An answer for each request of one body; what arrived as an error stays one.

        Raises InvalidRequest when the body carries too many frames.
        """
        began = time.perf_counter()
        check_frame_count(sum(len(r.frames) for r in requests if isinstance(r, SubgoalRequest)), self.info.limits)
        if len(requests) == 1:
            answers = [await self._answer_or_error(requests[0], caller)]
        else:
            answers = await asyncio.gather(*(self._answer_or_error(request, caller) for request in requests))
        log_answers(caller, answers, time.perf_counter() - began)
        return answers

    async def embed(self, request: EmbedRequest) -> EmbedReply:
        """The embeddings of texts. Raises InvalidRequest for too many or too long ones, Overloaded behind too many."""
        texts = admit_texts(request, self.info.limits)
        self._check_ready()
        if self._embedding >= self._settings.queue_size:
            raise Overloaded(f"{self._embedding} requests wait for embeddings", retry_after=1.0)
        self._embedding += 1
        self._idle.clear()
        try:
            embeddings = await self._host.embed(texts)
        finally:
            self._embedding -= 1
            self._note_idle()
        return EmbedReply(embedding_space=self.info.embedding_space, embeddings=embeddings)

    async def _answer_or_error(
        self, request: SubgoalRequest | PlannerError, caller: Caller
    ) -> SubgoalReply | PlannerError:
        began = time.perf_counter()
        answer: SubgoalReply | PlannerError
        self._in_flight += 1
        self._idle.clear()
        try:
            answer = request if isinstance(request, PlannerError) else await self.answer(request, caller)
        except PlannerError as error:
            answer = error.as_value()
        finally:
            self._in_flight -= 1
            self._note_idle()
        seconds = time.perf_counter() - began
        self.metrics.answer(answer, seconds)
        if isinstance(answer, SubgoalReply) and isinstance(request, SubgoalRequest):
            self.recent.answer(request, answer, caller, seconds)
        return answer

    def _note_idle(self) -> None:
        if not self._in_flight and not self._embedding:
            self._idle.set()

    def _on_batch(self, size: int, seconds: float) -> None:
        self.metrics.batch(size, seconds)
        self.recent.batch(size)

    def _check_ready(self) -> None:
        if self._draining:
            raise Unavailable("the service is stopping")
        if not self._batcher.running:
            raise Unavailable("the service is starting or stopping")
        if not self._host.ready:
            raise Unavailable("the planner is being started again; try again in a while")

    def _reply(self, request: SubgoalRequest, thought: Thought, timings: Timings) -> SubgoalReply:
        instructions = thought.plan.instructions
        return SubgoalReply(
            request_id=request.request_id,
            subgoal=instructions[0],
            instructions=instructions if request.mode == "plan" else (),
            embedding=thought.embedding,
            confidence=thought.plan.confidence,
            planner=self.info.identity,
            embedding_space=self.info.embedding_space,
            timings=timings,
        )

    def _expose(self) -> None:
        info = self.info
        self.metrics.describe(
            planner=info.planner,
            revision=info.revision,
            prompt_hash=info.prompt_hash,
            embedding_space=info.embedding_space,
        )
        self.metrics.watch(
            queue_length=lambda: self._batcher.waiting,
            in_flight=lambda: self._in_flight,
            cache_entries=lambda: len(self._cache),
            ready=lambda: self.ready,
            planner_restarts=lambda: self._host.restarts,
        )
