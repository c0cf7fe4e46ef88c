"""A planner that only waits for others, in the service's own event loop: many requests at once, none batched."""

import asyncio
from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from thinknav_models import TextEncoder
from thinknav_proto import PlannerError
from thinknav_server.caller import Trace
from thinknav_server.hosts.base import Identity
from thinknav_server.images import PixelMemory
from thinknav_server.planners.base import Plan, PlanItem, PlannerIdentity
from thinknav_server.planners.isolate import checked
from thinknav_server.thinking import Question, Thought, decoded_batch


class AsyncPlanner(Protocol):
    """Plans item by item while it is open as an async context manager."""

    identity: PlannerIdentity

    @property
    def reachable(self) -> bool:
        """Whether asking it is worth a try."""

    async def __aenter__(self) -> Self: ...

    async def __aexit__(self, *error: object) -> None: ...

    async def plan(self, item: PlanItem, trace: Trace | None = None) -> Plan | PlannerError:
        """One answer. What it raises fails the item."""


class PlannerInLoop:
    """concurrency: calls to the planner at once."""

    batch_limit = 1
    abandons = True
    ahead = 0
    restarts = 0

    def __init__(self, planner: AsyncPlanner, text_encoder: TextEncoder, concurrency: int) -> None:
        self.slots = concurrency
        self.identity = Identity(planner.identity, text_encoder.space, text_encoder.dimension)
        self._planner = planner
        self._text_encoder = text_encoder
        self._memory = PixelMemory()

    @property
    def ready(self) -> bool:
        return self._planner.reachable

    async def __aenter__(self) -> Self:
        await self._planner.__aenter__()
        return self

    async def __aexit__(self, *error: object) -> None:
        await self._planner.__aexit__(*error)

    async def think(self, questions: Sequence[Question]) -> Sequence[Thought | PlannerError]:
        return await asyncio.gather(*map(self._think, questions))

    async def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        return await asyncio.to_thread(self._text_encoder.encode, texts)

    async def _think(self, question: Question) -> Thought | PlannerError:
        loop = asyncio.get_running_loop()
        began = loop.time()
        (item,) = decoded_batch([question.request], self._memory).items
        if isinstance(item, PlannerError):
            return item
        try:
            plan = checked(await self._planner.plan(item, question.trace))
        except PlannerError as error:
            return error.as_value()
        if isinstance(plan, PlannerError):
            return plan
        planned = loop.time()
        (embedding,) = await self.embed(plan.instructions[:1])
        return Thought(plan, embedding, planned - began, loop.time() - planned)
