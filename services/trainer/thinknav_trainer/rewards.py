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
    standing_before, standing: (n,) int8, the episode's last judgement before and after this step; 0 without one, and
    after a stop.
    progress: (n,) float32, metres that the goal came nearer.
    price: what a think costs: `think.cost`, or what keeps `think.budget`.
    share: of the run that is done, 0 to 1. discount: the learner's.
    """

    thought: NDArray[np.bool_]
    agreement: NDArray[np.int8]
    standing_before: NDArray[np.int8]
    standing: NDArray[np.int8]
    progress: NDArray[np.float32]
    price: float
    share: float
    discount: float


RewardScheme = Callable[[ThinkStep, ThinkConfig], Terms]


def task(step: ThinkStep, config: ThinkConfig) -> Terms:  # noqa: ARG001
    """The task alone: thinking is free, but for the step that it takes."""
    return {}


def think_cost(step: ThinkStep, config: ThinkConfig) -> Terms:  # noqa: ARG001
    """Each think costs its price; nothing else is said about how to use it."""
    return {"think_cost": -step.price * step.thought.astype(np.float32)}


def paper(step: ThinkStep, config: ThinkConfig) -> Terms:
    """The paper's (section 3.2.3): the cost, and +-bonus for the next action's agreement with the subgoal.

    The bonus can be farmed: think, agree, undo, again. It is here to be reproduced, not to be recommended.
    """
    return _with_agreement(step, config, config.agreement_bonus)


def annealed(step: ThinkStep, config: ThinkConfig) -> Terms:
    """The paper's, with a bonus that fades to nothing when `config.bonus_until` of the run is done.

    It keeps thinking alive until the policy can read thoughts, and leaves nothing to farm afterwards.
    """
    return _with_agreement(step, config, config.agreement_bonus * max(0.0, 1 - step.share / config.bonus_until))


def capped(step: ThinkStep, config: ThinkConfig) -> Terms:
    """The paper's, with a bonus no larger than the price: to think and agree for ever earns nothing."""
    return _with_agreement(step, config, min(config.agreement_bonus, step.price))


def progress_gated(step: ThinkStep, config: ThinkConfig) -> Terms:
    """The paper's, but agreement pays only in a step that brings the goal nearer. Disagreement costs as ever."""
    gated = np.where((step.agreement > 0) & (step.progress <= 0), 0, step.agreement)
    return think_cost(step, config) | {"agreement": config.agreement_bonus * gated.astype(np.float32)}


def potential(step: ThinkStep, config: ThinkConfig) -> Terms:
    """Agreement as a potential (Ng et al. 1999): discount x bonus x the new standing - bonus x the old one.

    What agreement earns is paid back when the standing changes or the episode ends with a stop, so that no policy gains
    or loses by it in the end; it only comes early. Where time runs out the learner's bootstrap stands for the rest.
    """
    change = step.discount * step.standing.astype(np.float32) - step.standing_before.astype(np.float32)
    return think_cost(step, config) | {"agreement": (config.agreement_bonus * change).astype(np.float32)}


def _with_agreement(step: ThinkStep, config: ThinkConfig, bonus: float) -> Terms:
    return think_cost(step, config) | {"agreement": bonus * step.agreement.astype(np.float32)}


REWARD_SCHEMES: dict[str, RewardScheme] = {
    "task": task,
    "think_cost": think_cost,
    "paper": paper,
    "annealed": annealed,
    "capped": capped,
    "progress_gated": progress_gated,
    "potential": potential,
}
