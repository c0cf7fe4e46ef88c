"""What drives agents through episodes: a policy, a script, an agent that does what it is told."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_trainer.thoughts import Thought


class Agent(Protocol):
    """Drives N envs side by side; what it remembers of each lasts for an episode.

    Asked for actions and told of ends in turn, once each a step.
    """

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:
        """The next actions (N,).

        observations: of all N envs. thoughts: the replies to those of the last actions that were think, failed ones
        among them, but for envs whose episode has ended since.
        """

    def ended(self, done: NDArray[np.bool_]) -> None:
        """Forget the episodes that ended with the last actions. done: (N,)."""


class Demonstrator(Agent, Protocol):
    """An agent that also says what to do where another one acts: it is told what was done between the two."""

    def took(self, actions: NDArray[np.int64]) -> None:
        """These actions (N,) were taken in the place of the last ones that it named."""
