"""Thinks that are not the policy's own choice, and what learning makes of them.

With a probability f, which the strategy sets for each step, a think takes the place of the policy's action. So actions
come from the mixture b(a) = (1 - f) pi(a) + f [a = think]; and b is what is learnt: its log-probability is stored with
the transition, f beside it, and the update takes the same mixture of the new pi. The ratio begins at one as it should,
a think that would have been forced anyway gets little of the credit, and one that was certain (f = 1) moves no weight.
"""

import torch
from torch import Tensor

from thinknav_sim.task_config import Action

# The observation (n,) float32 that holds f; absent where nothing is forced.
FORCED_THINK = "forced_think"


def acting_log_probs(log_probs: Tensor, forced: Tensor | None) -> Tensor:
    """Log-probabilities (n, A) of the mixture from those of the policy, and f (n,)."""
    if forced is None:
        return log_probs
    free = log_probs + torch.log1p(-forced)[:, None]
    think = torch.logaddexp(free[:, Action.THINK], forced.log())
    return torch.cat([free[:, : Action.THINK], think[:, None]], dim=1)
