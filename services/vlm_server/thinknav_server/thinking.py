"""What is done with a batch of requests: decode the frames, plan, embed the subgoals.

It blocks and knows nothing of queues or processes; `hosts` says where it runs. A batch may be decoded while the one
before it is planned.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_models import TextEncoder
from thinknav_proto import PlannerError, SubgoalRequest
from thinknav_server.caller import Trace
from thinknav_server.images import PixelMemory, decode_frame
from thinknav_server.planners.base import Plan, PlanItem, Planner, View
from thinknav_server.planners.isolate import plan_each


@dataclass(frozen=True)
class Question:
    """An admitted request, and the trace it belongs to."""

    request: SubgoalRequest
    trace: Trace | None = None


@dataclass(frozen=True)
class Thought:
    """A plan, the embedding (512,) of its first instruction, and the seconds that its batch took for each."""

    plan: Plan
    embedding: NDArray[np.float32]
    planned: float
    embedded: float


@dataclass(frozen=True)
class DecodedBatch:
    """Requests with their frames as pixels, or the error in one of them, and the seconds that this took for all."""

    items: Sequence[PlanItem | PlannerError]
    seconds: float


@dataclass(frozen=True)
class Thinker:
    """A planner and the text encoder that embeds what it says."""

    planner: Planner
    text_encoder: TextEncoder

    def think(self, requests: Sequence[SubgoalRequest]) -> list[Thought | PlannerError]:
        """An answer for each request; one whose frame is no image, or that the planner chokes on, fails alone."""
        return self.think_decoded(decoded_batch(requests, PixelMemory()))

    def think_decoded(self, batch: DecodedBatch) -> list[Thought | PlannerError]:
        """The same."""
        items = batch.items
        began = time.perf_counter() - batch.seconds
        plans = iter(plan_each(self.planner, [item for item in items if isinstance(item, PlanItem)]))
        answers = [next(plans) if isinstance(item, PlanItem) else item for item in items]
        planned = time.perf_counter()
        subgoals = [answer.instructions[0] for answer in answers if isinstance(answer, Plan)]
        embeddings = iter(self.text_encoder.encode(subgoals)) if subgoals else iter(())
        embedded = time.perf_counter()
        return [
            Thought(answer, next(embeddings), planned - began, embedded - planned)
            if isinstance(answer, Plan)
            else answer
            for answer in answers
        ]


def decoded_batch(requests: Sequence[SubgoalRequest | PlannerError], memory: PixelMemory) -> DecodedBatch:
    """Requests, those that are errors already as they are. memory: for their pixels."""
    began = time.perf_counter()
    items = [request if isinstance(request, PlannerError) else _decoded(request, memory) for request in requests]
    return DecodedBatch(items, time.perf_counter() - began)


def _decoded(request: SubgoalRequest, memory: PixelMemory) -> PlanItem | PlannerError:
    try:
        return PlanItem(
            frame=decode_frame(request.frame, memory),
            goal=request.goal,
            mode=request.mode,
            recent=tuple(View(decode_frame(frame, memory), frame.heading) for frame in request.recent),
            temperature=request.temperature,
        )
    except PlannerError as error:
        return error.as_value()
