"""The planning service, told from a request to its reply: admit, batch, plan, embed, answer.

Knows nothing of HTTP or any other door; they all call `answer_each`, `embed` and `info`.
"""

import asyncio
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from thinknav_models import TextEncoder
from thinknav_proto import (
    EMBEDDING_DIMENSION,
    PROTOCOL_VERSION,
    EmbedReply,
    EmbedRequest,
    PlannerError,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
    Timings,
    Unavailable,
)
from thinknav_server.batcher import Batcher
from thinknav_server.images import decode_frame
from thinknav_server.limits import admit, admit_texts, check_frame_count
from thinknav_server.planners import Plan, PlanItem, Planner, View
from thinknav_server.planners.isolate import plan_each
from thinknav_server.settings import Settings


@dataclass(frozen=True)
class _Thought:
    """What the worker thread makes of a request: a plan, the embedding of its subgoal, and their seconds."""

    plan: Plan
    embedding: NDArray[np.float32]
    planned: float
    embedded: float


class PlanningService:
    """Answers requests for subgoals while it is open as an async context manager."""

    def __init__(self, planner: Planner, text_encoder: TextEncoder, settings: Settings) -> None:
        if text_encoder.dimension != EMBEDDING_DIMENSION:
            raise ValueError(
                f"the text encoder {text_encoder.space} gives embeddings of {text_encoder.dimension} values, "
                f"the protocol carries {EMBEDDING_DIMENSION}"
            )
        identity = planner.identity
        self.info = PlannerInfo(
            protocol_version=PROTOCOL_VERSION,
            planner=identity.name,
            revision=identity.revision,
            prompt_hash=identity.prompt_hash,
            embedding_space=str(text_encoder.space),
            limits=settings.limits,
        )
        self._planner = planner
        self._text_encoder = text_encoder
        self._batcher: Batcher[SubgoalRequest, _Thought] = Batcher(
            self._think,
            max_batch=settings.max_batch,
            max_wait=settings.max_wait,
            queue_size=settings.queue_size,
        )

    async def __aenter__(self) -> Self:
        await self._batcher.__aenter__()
        return self

    async def __aexit__(self, *error: object) -> None:
        await self._batcher.__aexit__(*error)

    def introduce(self) -> PlannerInfo:
        """Who answers, told while requests are answered. Raises Unavailable at other times."""
        if not self.ready:
            raise Unavailable("the service is starting or stopping")
        return self.info

    @property
    def ready(self) -> bool:
        """Whether requests are answered now."""
        return self._batcher.running

    async def answer(self, request: SubgoalRequest) -> SubgoalReply:
        """The subgoal for one request. Raises the PlannerError that stood in its way."""
        admit(request, self.info.limits)
        batched = await self._batcher.submit(request, request.deadline)
        thought = batched.result
        return SubgoalReply(
            request_id=request.request_id,
            subgoal=thought.plan.instructions[0],
            instructions=thought.plan.instructions if request.mode == "plan" else (),
            embedding=thought.embedding,
            embedding_space=self.info.embedding_space,
            confidence=thought.plan.confidence,
            planner=self.info.identity,
            timings=Timings(queued=batched.queued, planned=thought.planned, embedded=thought.embedded),
        )

    async def answer_each(self, requests: Sequence[SubgoalRequest | PlannerError]) -> list[SubgoalReply | PlannerError]:
        """An answer for each request of one body; what arrived as an error stays one.

        Raises InvalidRequest when the body carries too many frames.
        """
        check_frame_count(sum(len(r.frames) for r in requests if isinstance(r, SubgoalRequest)), self.info.limits)
        return await asyncio.gather(*map(self._answer_or_error, requests))

    async def embed(self, request: EmbedRequest) -> EmbedReply:
        """The embeddings of texts. Raises InvalidRequest for too many or too long ones."""
        texts = admit_texts(request, self.info.limits)
        embeddings = await asyncio.to_thread(self._text_encoder.encode, texts)
        return EmbedReply(embedding_space=self.info.embedding_space, embeddings=embeddings)

    async def _answer_or_error(self, request: SubgoalRequest | PlannerError) -> SubgoalReply | PlannerError:
        if isinstance(request, PlannerError):
            return request
        try:
            return await self.answer(request)
        except PlannerError as error:
            return error

    def _think(self, requests: Sequence[SubgoalRequest]) -> Sequence[_Thought | PlannerError]:
        """Decode, plan and embed a batch, in the worker thread; a frame that is no image fails alone."""
        began = time.monotonic()
        items = [_decoded(request) for request in requests]
        plans = iter(plan_each(self._planner, [item for item in items if isinstance(item, PlanItem)]))
        answers = [next(plans) if isinstance(item, PlanItem) else item for item in items]
        planned = time.monotonic()
        subgoals = [answer.instructions[0] for answer in answers if isinstance(answer, Plan)]
        embeddings = iter(self._text_encoder.encode(subgoals))
        embedded = time.monotonic()
        return [
            _Thought(answer, next(embeddings), planned - began, embedded - planned)
            if isinstance(answer, Plan)
            else answer
            for answer in answers
        ]


def _decoded(request: SubgoalRequest) -> PlanItem | PlannerError:
    try:
        return PlanItem(
            frame=decode_frame(request.frame),
            goal=request.goal,
            mode=request.mode,
            recent=tuple(View(decode_frame(frame), frame.heading) for frame in request.recent),
            temperature=request.temperature,
        )
    except PlannerError as error:
        return error
