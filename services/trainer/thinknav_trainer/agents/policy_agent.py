"""A trained policy as an agent."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_trainer.actor import Actor
from thinknav_trainer.thoughts import Thought


class PolicyAgent:
    """Acts as its actor does; what it was told is in the observations."""

    def __init__(self, actor: Actor) -> None:
        self._actor = actor

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        decision = self._actor.decide(self._actor.look(observations))
        self._actor.advance(decision, np.zeros(len(decision.actions), np.bool_))
        actions: NDArray[np.int64] = decision.actions.numpy()
        return actions

    def ended(self, done: NDArray[np.bool_]) -> None:
        self._actor.forget(done)
