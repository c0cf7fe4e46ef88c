"""The policy that a warm start left, held fixed, which looks on while its pupil learns from rewards.

In many homes a rollout says little about most of what a policy does, and what the rewards do not speak of can
drift away in the noise of the gradients. So the pupil pays for what it no longer does as it was taught: the
Kullback-Leibler divergence of its actions from the reference's is part of PPO's loss (kickstarting, Schmitt et al.
2018). Knows nothing of envs.
"""

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from thinknav_trainer.actor import EVERYONE, Rows, forward
from thinknav_trainer.config import Precision
from thinknav_trainer.policy import Policy

# The observation (n, A) float32 that holds the reference's log-probabilities; absent where there is none.
REFERENCE = "reference"


class Reference:
    """Follows N agents with a copy of their policy, and an LSTM state of its own.

    log_probs: (N, A) of what it would have done when each agent decided last.
    """

    def __init__(self, policy: Policy, count: int, precision: Precision) -> None:
        self.log_probs = torch.zeros(count, policy.shape.num_actions)
        self._policy = copy.deepcopy(policy)
        self._precision = precision
        self._hidden = policy.initial_hidden(count)
        self._after = torch.zeros_like(self._hidden)  # the states with which it decided

    def become(self, weights: Mapping[str, Any]) -> None:
        """Take on the weights of a policy, as its `state_dict` has them; all agents begin episodes."""
        self._policy.load_state_dict(weights)
        self._hidden.zero_()

    def decide(self, observations: Mapping[str, NDArray[Any]], previous: Tensor, agents: Rows = EVERYONE) -> None:
        """Think of what to do in the place of some agents, who observe (n, ...) after their actions (n,)."""
        hidden = self._hidden[:, :, agents]
        logits, _, after = forward(self._policy, self._precision, observations, previous, hidden)
        self.log_probs[agents], self._after[:, :, agents] = logits.log_softmax(dim=1), after

    def advance(self, done: NDArray[np.bool_], agents: Rows = EVERYONE) -> None:
        """Some agents took their actions; where an episode ended (n,), forget it."""
        self._hidden[:, :, agents] = self._after[:, :, agents] * ~torch.from_numpy(done)[None, None, :, None]

    def state_dict(self) -> dict[str, Any]:
        states = {"log_probs": self.log_probs, "hidden": self._hidden, "after": self._after}
        return {"policy": self._policy.state_dict()} | {name: state.clone() for name, state in states.items()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        self._policy.load_state_dict(state["policy"])
        self.log_probs, self._hidden, self._after = (state[name].clone() for name in ("log_probs", "hidden", "after"))


def divergence(log_probs: Tensor, reference: Tensor) -> Tensor:
    """Kullback-Leibler divergence of a policy (M, A) from the reference (M, A): the mean over transitions."""
    return functional.kl_div(log_probs, reference, reduction="batchmean", log_target=True)
