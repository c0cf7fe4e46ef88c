"""An agent that farms the paper's bonus: it thinks, does what it is told, undoes it, and thinks again; it never stops.

It shows in the simulator what docs/thinking.md works out on paper, and knows what every policy knows.
"""

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action
from thinknav_trainer.agents.obedient import opposite
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.thoughts import Thought


class Farmer:
    """Drives N envs; each has actions in hand before it thinks again."""

    def __init__(self, num_envs: int) -> None:
        self._plans: list[deque[Action]] = [deque() for _ in range(num_envs)]

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        for thought in thoughts:
            self._plans[thought.env] = deque(_harvest(thought.subgoal))
        return np.array([plan.popleft() if plan else Action.THINK for plan in self._plans], np.int64)

    def ended(self, done: NDArray[np.bool_]) -> None:
        for env in np.flatnonzero(done).tolist():
            self._plans[env].clear()


def _harvest(subgoal: str | None) -> list[Action]:
    """What it does about a subgoal. After a step forward it looks away, so as to be told to turn back."""
    direction = None if subgoal is None else subgoal_direction(subgoal)
    if direction in (Action.TURN_LEFT, Action.TURN_RIGHT):
        return [direction, opposite(direction)]
    return [Action.MOVE_FORWARD, Action.TURN_LEFT] if direction == Action.MOVE_FORWARD else [Action.TURN_LEFT]
