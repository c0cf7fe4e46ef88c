"""A policy that acts for N agents: it remembers what they did and felt. Knows nothing of envs, rewards and learning."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from thinknav_trainer.config import Precision
from thinknav_trainer.forcing import FORCED_THINK, acting_log_probs
from thinknav_trainer.glances import Glances
from thinknav_trainer.policy import Policy
from thinknav_trainer.precision import autocast

NO_ACTION = -1

Rows = slice | NDArray[np.int64]
EVERYONE = slice(None)


@dataclass(frozen=True)
class Decision:
    """What n agents do. actions: (n,) int64. log_probs, values: (n,). hidden: the state after it, (2, layers, n, H)."""

    actions: Tensor
    log_probs: Tensor
    values: Tensor
    hidden: Tensor

    def select(self, agents: Rows) -> "Decision":
        """That of some agents."""
        return Decision(self.actions[agents], self.log_probs[agents], self.values[agents], self.hidden[:, :, agents])

    def update(self, agents: Rows, decision: "Decision") -> "Decision":
        """This one with another in the place of some agents'; those rows are written over."""
        if isinstance(agents, slice):
            return decision
        self.actions[agents], self.log_probs[agents] = decision.actions, decision.log_probs
        self.values[agents], self.hidden[:, :, agents] = decision.values, decision.hidden
        return self


class Actor:
    """Samples actions, or takes the likeliest ones when `greedy`.

    previous: (N,) the last actions, NO_ACTION where an episode begins. hidden: the LSTM's state. All that it keeps and
    gives is on the CPU.
    """

    def __init__(self, policy: Policy, count: int, precision: Precision, seed: int, greedy: bool = False) -> None:
        self.previous = torch.full((count,), NO_ACTION)
        self.hidden = policy.initial_hidden(count)
        self._policy = policy
        self._precision = precision
        self._greedy = greedy
        self._generator = torch.Generator().manual_seed(seed)
        self._glances = Glances(policy.vision, count)

    def no_decision(self) -> Decision:
        """Of agents who have not decided anything yet."""
        count = len(self.previous)
        nothing = torch.full((count,), NO_ACTION)
        return Decision(nothing, torch.zeros(count), torch.zeros(count), torch.zeros_like(self.hidden))

    def look(self, observations: Mapping[str, NDArray[Any]], agents: Rows = EVERYONE) -> dict[str, NDArray[Any]]:
        """What the policy keeps of what some agents observe now. Whoever keeps it looks first: that is done once, it is
        small, and who sees what it saw does not look again.

        `decide` and `values` take observations looked at or not.
        """
        return self._glances.look(observations, np.arange(len(self.previous))[agents])

    def decide(self, observations: Mapping[str, NDArray[Any]], agents: Rows = EVERYONE) -> Decision:
        """Choose the next actions of some agents, who observe (n, ...)."""
        previous, hidden = self.previous[agents], self.hidden[:, :, agents]
        logits, values, hidden = forward(self._policy, self._precision, observations, previous, hidden)
        forced = observations.get(FORCED_THINK)
        log_probs = acting_log_probs(logits.log_softmax(dim=1), None if forced is None else torch.from_numpy(forced))
        if self._greedy:
            actions = log_probs.argmax(dim=1, keepdim=True)
        else:
            actions = torch.multinomial(log_probs.exp(), 1, generator=self._generator)
        return Decision(actions[:, 0], log_probs.gather(1, actions)[:, 0], values, hidden)

    def values(self, observations: Mapping[str, NDArray[Any]], previous: Tensor, hidden: Tensor) -> Tensor:
        """What observations are worth, without acting on them."""
        return forward(self._policy, self._precision, observations, previous, hidden)[1]

    def advance(self, decision: Decision, done: NDArray[np.bool_], agents: Rows = EVERYONE) -> None:
        """Some agents took their actions; where an episode ended (n,), forget it."""
        previous, hidden = _without_ended(decision.actions, decision.hidden, done)
        if isinstance(agents, slice):
            self.previous, self.hidden = previous, hidden
        else:
            self.previous[agents], self.hidden[:, :, agents] = previous, hidden

    def forget(self, done: NDArray[np.bool_]) -> None:
        """Episodes (N,) ended."""
        self.previous, self.hidden = _without_ended(self.previous, self.hidden, done)

    def forget_everything(self) -> None:
        """All agents begin episodes."""
        self.forget(np.ones(len(self.previous), np.bool_))

    def state_dict(self) -> dict[str, Any]:
        return {
            "previous": self.previous,
            "hidden": self.hidden,
            "generator": self._generator.get_state(),
            "glances": self._glances.state_dict(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.previous, self.hidden = state["previous"], state["hidden"]
        self._generator.set_state(state["generator"])
        if "glances" in state:  # older checkpoints have none
            self._glances.load_state_dict(state["glances"])


@torch.no_grad()
def forward(
    policy: Policy, precision: Precision, observations: Mapping[str, NDArray[Any]], previous: Tensor, hidden: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """A policy's logits, values and next state, on the CPU, wherever it computes."""
    device = policy.device
    looked = policy.vision.look(_tensors(observations))  # where the observations are
    there = {name: values.to(device) for name, values in looked.items()}
    with autocast(precision, device):
        logits, values, after = policy.step(there, previous.to(device), hidden.to(device))
    return logits.cpu(), values.cpu(), after.cpu()


def _without_ended(actions: Tensor, hidden: Tensor, done: NDArray[np.bool_]) -> tuple[Tensor, Tensor]:
    """Last actions (n,) and states (2, layers, n, H), as they are at the start of an episode where one ended (n,)."""
    ended = torch.from_numpy(done)
    return torch.where(ended, NO_ACTION, actions), hidden * ~ended[None, None, :, None]


def _tensors(observations: Mapping[str, NDArray[Any]]) -> dict[str, Tensor]:
    return {name: torch.from_numpy(values) for name, values in observations.items()}
