"""The plainest obedience, which a perfect planner leads to the goal."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.thoughts import Thought


class ThinkAndObey:
    """Thinks, does what it is told, and thinks again."""

    def __init__(self, num_envs: int) -> None:
        self._told = np.full(num_envs, Action.THINK, np.int64)

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:
        for thought in thoughts:
            direction = subgoal_direction(str(thought.subgoal))
            assert direction is not None
            self._told[thought.env] = direction
        chosen, self._told = self._told, np.full_like(self._told, Action.THINK)
        return chosen

    def took(self, actions: NDArray[np.int64]) -> None:
        """Who thinks instead waits for what it is told; who does anything else instead thinks next."""

    def ended(self, done: NDArray[np.bool_]) -> None:
        self._told[done] = Action.THINK
