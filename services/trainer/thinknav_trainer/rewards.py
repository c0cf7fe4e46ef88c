"""Reward schemes: what thinking costs and earns, on top of the task's own reward.

A scheme is a function from what happened in a step to named terms, each (n,) float32; the learner gets the task's
terms plus their sum, and the log gets each apart. Knows nothing of planners or networks.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_trainer.config import ThinkConfig

Terms = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class ThinkStep:
    """What a scheme may look at, for n agents.

    thought: (n,) bool, the action was think.
    agreement: (n,) int8, +1 the action did what the subgoal said, -1 it did something else, 0 nothing was judged.
    """

    thought: NDArray[np.bool_]
    agreement: NDArray[np.int8]


RewardScheme = Callable[[ThinkStep, ThinkConfig], Terms]


def task(step: ThinkStep, config: ThinkConfig) -> Terms:  # noqa: ARG001
    """The task alone: thinking is free, but for the step that it takes."""
    return {}


def think_cost(step: ThinkStep, config: ThinkConfig) -> Terms:
    """Each think costs `config.cost`; nothing else is said about how to use it."""
    return {"think_cost": -config.cost * step.thought.astype(np.float32)}


def paper(step: ThinkStep, config: ThinkConfig) -> Terms:
    """The paper's (section 3.2.3): the cost, and +-bonus for the next action's agreement with the subgoal.

    The bonus can be farmed: think, agree, undo, again. It is here to be reproduced, not to be recommended.
    """
    return think_cost(step, config) | {"agreement": config.agreement_bonus * step.agreement.astype(np.float32)}


REWARD_SCHEMES: dict[str, RewardScheme] = {"task": task, "think_cost": think_cost, "paper": paper}
