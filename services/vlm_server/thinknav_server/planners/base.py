"""What a planner is: one small class that the service calls with batches, in a worker thread.

A planner sees pixels and goals; it knows nothing of requests, queues, deadlines or embeddings.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import PlannerError


@dataclass(frozen=True)
class PlannerIdentity:
    """Who plans: its name, a hash of its weights or script, and a hash of its prompt ("none" without one)."""

    name: str
    revision: str
    prompt_hash: str


@dataclass(frozen=True)
class View:
    """An earlier frame (H, W, 3) uint8; its heading in radians relative to the current one, left positive."""

    frame: NDArray[np.uint8]
    heading: float


@dataclass(frozen=True)
class PlanItem:
    """One question. frame: (H, W, 3) uint8 RGB. recent: earlier views, oldest first."""

    frame: NDArray[np.uint8]
    goal: str
    mode: Literal["subgoal", "plan"] = "subgoal"
    recent: tuple[View, ...] = ()
    temperature: float = 0.0


@dataclass(frozen=True)
class Plan:
    """One answer.

    instructions: one in the mode "subgoal", one or more in the mode "plan". confidence: 0 to 1, or None.
    """

    instructions: tuple[str, ...]
    confidence: float | None = None


class Planner(Protocol):
    """Answers batches. Calls come one after another, from one worker thread."""

    @property
    def identity(self) -> PlannerIdentity:
        """Constant while the service runs."""

    def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
        """One answer for each item, in their order; a PlannerError for an item that failed alone.

        What it raises fails the whole batch, which the service then asks again in halves to find the culprit.
        """
