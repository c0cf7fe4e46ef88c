"""Thinking strategies: when an agent thinks, whatever its policy wants.

A strategy gives the probability that a think takes the place of the policy's action. Knows neither policies
nor planners.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from thinknav_trainer.config import ThinkConfig

# (steps of the episode so far (n,), share of the run that is done, config) -> probabilities (n,) float32
Strategy = Callable[[NDArray[np.int64], float, ThinkConfig], NDArray[np.float32]]


def agent(steps: NDArray[np.int64], share: float, config: ThinkConfig) -> NDArray[np.float32]:
    """The policy decides; at first it is made to think now and then, so that it can learn what thinking is good for.

    The probability falls from `config.forced` to nothing when `config.forced_until` of the run is done.
    """
    left = max(0.0, 1 - share / config.forced_until)
    return np.full(len(steps), config.forced * left, np.float32)


def every_n(steps: NDArray[np.int64], share: float, config: ThinkConfig) -> NDArray[np.float32]:  # noqa: ARG001
    """The first step of an episode is a think, and each `config.every`-th after it."""
    return np.equal(steps % config.every, 0).astype(np.float32)


def once(steps: NDArray[np.int64], share: float, config: ThinkConfig) -> NDArray[np.float32]:  # noqa: ARG001
    """The first step of an episode is a think, which asks for a plan of it all."""
    return np.equal(steps, 0).astype(np.float32)


STRATEGIES: dict[str, Strategy] = {"agent": agent, "every_n": every_n, "once": once}
