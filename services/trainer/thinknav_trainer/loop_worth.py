"""What a reward scheme pays an agent that repeats a loop for ever: the arithmetic of farming (docs/thinking.md).

    worth_of_repeating(AGREE_AND_UNDO, "paper", ThinkConfig())    # 2.90, where success is worth 2.5

Knows schemes and their configuration; no env and no policy.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thinknav_trainer.config import ThinkConfig
from thinknav_trainer.rewards import REWARD_SCHEMES, ThinkStep

# After so many steps nothing counts any more: 0.99 to this power is below 1e-13.
FOR_EVER = 3_000


@dataclass(frozen=True)
class LoopStep:
    """One step. agreed: it did what the subgoal before it said. progress: metres that the goal came nearer."""

    thought: bool = False
    agreed: bool = False
    progress: float = 0.0


THINK, AGREE, UNDO = LoopStep(thought=True), LoopStep(agreed=True), LoopStep()

# The two that agents find: turn as told and back again, or be told over and over.
AGREE_AND_UNDO = (THINK, AGREE, UNDO)
AGREE_AGAIN = (THINK, AGREE)


def worth_of_repeating(
    loop: Sequence[LoopStep],
    scheme: str,
    config: ThinkConfig,
    discount: float = 0.99,
    slack: float = -0.001,
    share: float = 1.0,
    steps: int = FOR_EVER,
) -> float:
    """The discounted return of the loop, over and over from an episode's beginning, its progress and slack included.

    slack: the task's reward of a step. share: of the run that is done, for schemes that fade. steps: how long it goes
    on; whoever counts them as an episode's must know that the learner's bootstrap stands for the rest.
    """
    total, standing = 0.0, 0
    for number in range(steps):
        step = loop[number % len(loop)]
        after = 1 if step.agreed else standing
        terms = REWARD_SCHEMES[scheme](_think_step(step, standing, after, config.cost, share, discount), config)
        paid = slack + step.progress + sum(float(term[0]) for term in terms.values())
        total += discount**number * paid
        standing = after
    return total


def _think_step(step: LoopStep, before: int, after: int, price: float, share: float, discount: float) -> ThinkStep:
    return ThinkStep(
        thought=np.array([step.thought]),
        agreement=np.array([step.agreed], np.int8),
        standing_before=np.array([before], np.int8),
        standing=np.array([after], np.int8),
        progress=np.array([step.progress], np.float32),
        price=price,
        share=share,
        discount=discount,
    )
