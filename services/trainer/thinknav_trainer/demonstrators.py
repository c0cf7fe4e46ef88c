"""Who shows a policy what to do before it learns by itself: see `warm_start`.

Knows observations and replies; no network.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.thoughts import Thought


class Demonstrator(Protocol):
    """Drives N envs side by side; what it remembers of each lasts for an episode.

    Asked for actions and told of ends in turn, once each a step.
    """

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:
        """The next actions (N,). thoughts: the replies to the last ones, but for envs whose episode has ended since."""

    def ended(self, done: NDArray[np.bool_]) -> None:
        """Forget the episodes that ended with the last actions. done: (N,)."""


# Makes a demonstrator for all of an env's envs, from a seed.
MakeDemonstrator = Callable[[ThinkingEnv, int], Demonstrator]


class ThinkAndObey:
    """Thinks, does what it is told, and thinks again; told nothing, it goes forward. Nothing in it is privileged."""

    def __init__(self, num_envs: int) -> None:
        self._told = np.full(num_envs, Action.THINK, np.int64)

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        for thought in thoughts:
            direction = None if thought.subgoal is None else subgoal_direction(thought.subgoal)
            self._told[thought.env] = Action.MOVE_FORWARD if direction is None else direction
        chosen, self._told = self._told, np.full_like(self._told, Action.THINK)
        return chosen

    def ended(self, done: NDArray[np.bool_]) -> None:
        self._told[done] = Action.THINK


def think_and_obey(env: ThinkingEnv, seed: int) -> Demonstrator:  # noqa: ARG001 - it draws nothing
    """The demonstrator of a policy that may think."""
    return ThinkAndObey(env.num_envs)
