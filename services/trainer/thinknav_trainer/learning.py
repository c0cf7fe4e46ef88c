"""When a policy learns: from each rollout before the next is collected, or beside that, one rollout behind.

Beside, collecting and learning have a core each, and the policy that acts is that from before the update under
way. PPO knows by the stored log-probabilities what was acted on, and both ways give the same numbers every time, as
long as envs and planner do. Knows nothing of envs, logs and checkpoints.
"""

import copy
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from thinknav_trainer.policy import Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.threads import torch_threads
from thinknav_trainer.timing import Stopwatch

Losses = dict[str, float]


class Learning(Protocol):
    """Collects and learns, one of each for every call of `improve`."""

    acting: Policy

    def improve(self, collect: Callable[[], Rollout], remaining: float) -> tuple[Rollout, Losses]:
        """The rollout that was collected, and the losses of the one that was learnt from, none of the first.

        remaining: share of the run that is left as it is collected. Raises NotFinite.
        """

    def settle(self) -> None:
        """Learn what is still to be learnt: weights and optimiser are then those of all rollouts. Raises NotFinite."""

    def follow(self) -> None:
        """The learner's weights were changed by someone else: act by them."""


class InTurn:
    """Learns from each rollout at once."""

    def __init__(self, learner: PPO, stopwatch: Stopwatch) -> None:
        self.acting = learner.policy
        self._learner = learner
        self._stopwatch = stopwatch

    def improve(self, collect: Callable[[], Rollout], remaining: float) -> tuple[Rollout, Losses]:
        rollout = collect()
        with self._stopwatch("learn"):
            return rollout, self._learner.update(rollout, remaining)

    def settle(self) -> None:
        """Nothing is left to be learnt."""

    def follow(self) -> None:
        """It acts by the learner's own weights."""


class Beside:
    """Learns from each rollout in a thread of its own, while the next one is collected.

    acting: a policy of its own, with the learner's weights of before. What is timed as learning is the wait for it.
    """

    def __init__(self, learner: PPO, stopwatch: Stopwatch) -> None:
        self.acting = copy.deepcopy(learner.policy)
        self._learner = learner
        self._stopwatch = stopwatch
        self._thread = ThreadPoolExecutor(1, "learning")
        self._collected: tuple[Rollout, float] | None = None  # and the share of the run that was left
        self._settled: Losses = {}

    def improve(self, collect: Callable[[], Rollout], remaining: float) -> tuple[Rollout, Losses]:
        learning = self._begin()
        try:
            rollout = collect()
        finally:
            losses = self._end(learning)
        self._collected = rollout, remaining
        return rollout, losses

    def settle(self) -> None:
        self._settled = self._end(self._begin())

    def follow(self) -> None:
        self.acting.load_state_dict(self._learner.policy.state_dict())

    def _begin(self) -> "Future[Losses] | None":
        """Begin to learn from what was collected last."""
        collected, self._collected = self._collected, None
        return None if collected is None else self._thread.submit(self._learn, *collected)

    @torch_threads(1)
    def _learn(self, rollout: Rollout, remaining: float) -> Losses:
        return self._learner.update(rollout, remaining)

    def _end(self, learning: "Future[Losses] | None") -> Losses:
        """Wait for it, and act by what was learnt."""
        if learning is None:
            losses, self._settled = self._settled, {}
            return losses
        with self._stopwatch("learn"):
            losses = learning.result()
        self.follow()
        return losses
