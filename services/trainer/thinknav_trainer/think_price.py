"""What a think costs: the same throughout a run, or a price that rises and falls until a budget of thinks is kept.

The price is the Lagrange multiplier of "at most `think.budget` of the steps are thinks", learnt by ascent on the dual
while the policy learns: charged for each think, it rises while there are more of them, and falls, but never below
nothing, while there are fewer. Knows rollouts; nothing of rewards and policies.
"""

from typing import Any

import torch
from torch import Tensor

from thinknav_sim.task_config import Action
from thinknav_trainer.config import ThinkConfig
from thinknav_trainer.forcing import FORCED_THINK
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.workers import Workers


class ThinkPrice:
    """now: what a think costs, the same for all workers; `think.cost` to begin with, and always without a budget."""

    def __init__(self, config: ThinkConfig, workers: Workers) -> None:
        self.now = config.cost
        self._config = config
        self._workers = workers

    def update(self, rollout: Rollout, share: float) -> dict[str, float]:
        """Change the price by what all workers' rollouts show; what to log. All workers call it.

        share: of the run that is done.
        """
        budget = self._config.budget
        if budget is None:
            return {}
        thinks, steps = self._workers.sum(own_thinks(rollout)).tolist()
        rate = thinks / steps
        if share >= self._config.budget_after:
            excess = min(1.0, max(-1.0, rate / budget - 1))
            self.now = max(0.0, self.now + self._config.budget_lr * excess)
        return {"think_price": self.now, "own_think_rate": rate}

    def state_dict(self) -> dict[str, Any]:
        return {} if self._config.budget is None else {"now": self.now}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on with a price that a budget has changed; where there was or is none, `think.cost` is the price."""
        if self._config.budget is not None:
            self.now = state.get("now", self.now)


def own_thinks(rollout: Rollout) -> Tensor:
    """(2,) float64: how many thinks were the policy's own, and how many steps were left to it; as expected numbers.

    A think that came with probability b, f of which was forced, is the policy's own with probability 1 - f / b; and a
    step is left to the policy with probability 1 - f. So forced thinks cost, but do not move the price.
    """
    forced = rollout.observations.get(FORCED_THINK)
    f = torch.zeros(len(rollout), dtype=torch.float64) if forced is None else forced.double()
    thinks = rollout.actions == Action.THINK
    own = thinks * (1 - f / rollout.log_probs.double().exp()).clamp(0, 1)
    return torch.stack([own.sum(), (1 - f).sum()])
