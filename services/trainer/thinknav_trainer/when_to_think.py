"""How often a policy thinks in an evaluation: as it learnt to, more or less often than that, or by the clock.

One policy evaluated in several of these manners gives a curve of success against calls (`budget_curve`). Knows
configurations and networks; nothing of how episodes are played.
"""

import math
from dataclasses import dataclass

import torch

from thinknav_sim.task_config import Action
from thinknav_trainer.config import NEVER, ConfigError, TrainConfig
from thinknav_trainer.policy import Policy


@dataclass(frozen=True)
class WhenToThink:
    """bias: added to the logit of think. every: instead, each so-many-th step is a think, and no other one."""

    bias: float = 0.0
    every: int | None = None

    @property
    def as_learnt(self) -> bool:
        """Whether nothing is changed."""
        return self == WhenToThink()

    @property
    def name(self) -> str:
        """For folders."""
        return f"every-{self.every}" if self.every is not None else f"bias{self.bias:+g}"

    def configure(self, config: TrainConfig) -> TrainConfig:
        """The configuration with the strategy that this takes. Raises ConfigError where a policy cannot do that."""
        if self.as_learnt:
            return config
        if not math.isfinite(self.bias):
            raise ConfigError(
                f"a bias of thinking is a finite number, not {self.bias}; -20 is a policy that never asks"
            )
        if self.every is not None and self.bias:
            raise ConfigError("give either a bias of thinking or the steps from one think to the next")
        strategy = config.think.strategy
        if strategy not in ("agent", "every_n") or (self.bias and strategy != "agent"):
            raise ConfigError(f"a policy of think.strategy {strategy} cannot think in the manner {self.name}")
        if self.every is None:
            return config
        clocked = {"strategy": "every_n", "every": self.every, "forced": 0.0, "budget": None}
        return config.model_copy(update={"think": config.think.model_copy(update=clocked)})

    def apply(self, policy: Policy) -> None:
        """Change a policy's mind about thinking, in place."""
        if self.as_learnt:
            return
        with torch.no_grad():
            if self.every is None:
                policy.actor.bias[Action.THINK] += self.bias
            else:
                policy.actor.bias[Action.THINK] = NEVER
