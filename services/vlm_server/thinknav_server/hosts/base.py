"""What the service asks of whoever runs the planner and the text encoder for it.

A host knows nothing of queues, caches or clients.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from thinknav_models import EmbeddingSpace
from thinknav_proto import PlannerError
from thinknav_server.planners.base import PlannerIdentity
from thinknav_server.thinking import Question, Thought


@dataclass(frozen=True)
class Identity:
    """Who thinks: the planner, and the embedding space and dimension of its text encoder."""

    planner: PlannerIdentity
    space: EmbeddingSpace
    dimension: int


class Host(Protocol):
    """Thinks while it is open as an async context manager."""

    @property
    def identity(self) -> Identity:
        """Known before the host is open, and constant."""

    @property
    def slots(self) -> int:
        """Batches that it works on at once."""

    @property
    def ahead(self) -> int:
        """Full batches that it takes while all slots are busy, to prepare them."""

    @property
    def batch_limit(self) -> int | None:
        """Requests that it takes at once, if it sets a limit of its own."""

    @property
    def abandons(self) -> bool:
        """Whether it stops working on what it is asked when it is cancelled, rather than finishing in vain."""

    @property
    def ready(self) -> bool:
        """Whether it can be asked now."""

    @property
    def restarts(self) -> int:
        """How often its planner was started again."""

    async def __aenter__(self) -> Self: ...

    async def __aexit__(self, *error: object) -> None:
        """Ends at once, whatever the planner is doing."""

    async def think(self, questions: Sequence[Question]) -> Sequence[Thought | PlannerError]:
        """An answer for each question. Raises PlannerFailed or Unavailable when the whole batch is lost."""

    async def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """(N, dimension) float32. Raises PlannerFailed or Unavailable."""
