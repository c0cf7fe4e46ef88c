"""Plans of N agents: instructions for a whole episode, of which an agent sees one at a time.

The current instruction stays in view until an action does what its direction words say; one without such words stays
for one step. After the last there is nothing more to see. Knows nothing of planners and rewards.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.task_config import Action
from thinknav_trainer.direction import subgoal_direction


@dataclass(frozen=True)
class Instruction:
    """One step of a plan. embedding: (D,) float32."""

    text: str
    embedding: NDArray[np.float32]

    @property
    def direction(self) -> Action | None:
        """What it calls for, None if it does not say."""
        return subgoal_direction(self.text)


class Plans:
    """What is left of each agent's plan; nothing for one who has none."""

    def __init__(self, count: int) -> None:
        self._left: list[tuple[Instruction, ...]] = [()] * count

    def begin(self, agent: int, texts: Sequence[str], embeddings: NDArray[np.float32]) -> None:
        """A new plan, its embeddings (K, D)."""
        self._left[agent] = tuple(map(Instruction, texts, embeddings))

    def follow(self, agent: int, action: int) -> bool:
        """The agent acted: whether that brings its next instruction, or the plan's end, into view."""
        if not self._left[agent] or self._left[agent][0].direction not in (None, action):
            return False
        self._left[agent] = self._left[agent][1:]
        return True

    def current(self, agent: int) -> Instruction | None:
        """What the agent is to do now."""
        return self._left[agent][0] if self._left[agent] else None

    def forget(self, agent: int) -> None:
        """Its episode is over."""
        self._left[agent] = ()

    def state_dict(self) -> list[list[dict[str, Any]]]:
        """Every plan, as plain values and arrays."""
        return [[dict(vars(instruction)) for instruction in plan] for plan in self._left]

    def load_state_dict(self, state: Sequence[Sequence[dict[str, Any]]]) -> None:
        """Put the plans where `state_dict` was taken."""
        self._left = [tuple(Instruction(**instruction) for instruction in plan) for plan in state]
