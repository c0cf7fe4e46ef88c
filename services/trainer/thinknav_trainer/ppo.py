"""Proximal policy optimisation (Schulman et al. 2017) as Habitat's DD-PPO does it, on recurrent sequences.

Several workers' updates, each with its own rollout, are one update on all their transitions (`data_parallel`). Knows
the policy and the rollout; nothing of envs, planners and files.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from thinknav_trainer.config import PPOConfig
from thinknav_trainer.data_parallel import average_gradients, mean_and_deviation
from thinknav_trainer.dumps import NotFinite
from thinknav_trainer.forcing import FORCED_THINK, acting_log_probs
from thinknav_trainer.policy import Policy
from thinknav_trainer.precision import autocast
from thinknav_trainer.reference import REFERENCE, divergence
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.workers import Lone, Workers

LOSSES = ("policy_loss", "value_loss", "entropy", "approximate_kl", "clip_fraction")


class PPO:
    """The learner: a policy, its optimiser, and one `update` for each rollout."""

    def __init__(self, policy: Policy, config: PPOConfig, seed: int = 0, workers: Workers = Lone()) -> None:
        self.policy = policy
        self.config = config
        self.optimizer = torch.optim.Adam(policy.parameters(), lr=config.lr, eps=config.adam_eps, fused=True)
        self._order = np.random.default_rng(seed)
        self._workers = workers

    def update(self, rollout: Rollout, remaining: float = 1.0) -> dict[str, float]:
        """Several epochs over a rollout; means of the losses. remaining: share of the run that is left, for lr_decay.

        The rollout may be anywhere: it is brought to where the policy is. Raises NotFinite.
        """
        rollout = rollout.to(self.policy.device)
        if self.config.lr_decay:
            for group in self.optimizer.param_groups:
                group["lr"] = self.config.lr * remaining
        advantages = rollout.advantages
        if self.config.normalize_advantages:
            mean, deviation = mean_and_deviation(advantages, self._workers)
            advantages = (advantages - mean) / (deviation + 1e-5)
        with autocast(self.config.precision, self.policy.device):
            observations = self.policy.vision.prepare(rollout.observations)
        sums: dict[str, float] = {}
        for _ in range(self.config.epochs):
            order = self._order.permutation(len(rollout.sequence_starts))
            for chosen in np.array_split(order, self.config.minibatches):
                for name, value in self.minibatch(rollout, observations, advantages, chosen).items():
                    sums[name] = sums.get(name, 0.0) + value
        batches = self.config.epochs * self.config.minibatches
        return {name: value / batches for name, value in sums.items()}

    def minibatch(
        self, rollout: Rollout, observations: Mapping[str, Tensor], advantages: Tensor, chosen: NDArray[np.int64]
    ) -> dict[str, float]:
        """One gradient step on some sequences of a rollout, whose observations are prepared, and on the other workers'.

        Raises NotFinite.
        """
        evidence = partial(self._evidence, rollout, advantages, chosen)
        self.optimizer.zero_grad(set_to_none=True)
        # A worker whose rollout was cut short may have no sequence left, but the others wait for it.
        names = LOSSES + (("reference_kl",) if self.config.kl_coef else ())
        losses, weight = dict.fromkeys(names, 0.0), 0
        if len(chosen):
            losses, weight = self._backward(rollout, observations, advantages, chosen, evidence)
        losses = average_gradients(self.policy.parameters(), losses, weight, self._workers)
        losses["gradient_norm"] = self._clip_gradients(evidence)
        self.optimizer.step()
        return losses

    def _backward(
        self,
        rollout: Rollout,
        observations: Mapping[str, Tensor],
        advantages: Tensor,
        chosen: NDArray[np.int64],
        evidence: Callable[[], dict[str, Any]],
    ) -> tuple[dict[str, float], int]:
        """The gradients of this worker's sequences, its losses, and the number of transitions that both are means of.

        Raises NotFinite.
        """
        transitions, sequences = rollout.select(chosen)
        with autocast(self.config.precision, self.policy.device):
            logits, values = self.policy.sequence(
                {name: values[transitions] for name, values in observations.items()},
                rollout.previous_actions[transitions],
                sequences,
            )
        rows = transitions[sequences.index[sequences.mask]]  # the order in which the policy answered
        log_probs = logits.log_softmax(dim=1)
        forced = rollout.observations.get(FORCED_THINK)
        acting = acting_log_probs(log_probs, None if forced is None else forced[rows])
        chosen_log_probs = acting.gather(1, rollout.actions[rows, None])[:, 0]
        log_ratio = chosen_log_probs - rollout.log_probs[rows]
        policy_loss = self._policy_loss(log_ratio.exp(), advantages[rows])
        value_loss = self._value_loss(values, rollout.values[rows], rollout.returns[rows])
        entropy = -(log_probs.exp() * log_probs).sum(dim=1).mean()
        loss = policy_loss + self.config.value_coef * value_loss - self.config.entropy_coef * entropy
        losses = {"policy_loss": policy_loss.item(), "value_loss": value_loss.item(), "entropy": entropy.item()}
        if self.config.kl_coef:
            apart = divergence(log_probs, rollout.observations[REFERENCE][rows])
            loss = loss + self.config.kl_coef * apart
            losses["reference_kl"] = apart.item()
        wrong = [name for name, value in losses.items() if not math.isfinite(value)]
        if wrong:
            raise NotFinite(f"{', '.join(wrong)} of an update: {losses}", evidence())
        loss.backward()  # type: ignore[no-untyped-call]
        if self._workers.count > 1 and self._wrong_gradients():  # in the sum nobody could tell whose they were
            raise NotFinite(f"gradients of {', '.join(self._wrong_gradients())}", evidence())
        with torch.no_grad():
            losses["approximate_kl"] = (log_ratio.exp() - 1 - log_ratio).mean().item()
            losses["clip_fraction"] = ((log_ratio.exp() - 1).abs() > self.config.clip).float().mean().item()
        return losses, len(rows)

    def _clip_gradients(self, evidence: Callable[[], dict[str, Any]]) -> float:
        """The gradients' norm before they were clipped to the configured one."""
        try:
            norm = nn.utils.clip_grad_norm_(
                self.policy.parameters(), self.config.max_grad_norm, error_if_nonfinite=True
            )
        except RuntimeError:
            wrong = ", ".join(self._wrong_gradients()) or "all weights together"
            raise NotFinite(f"gradients of {wrong}", evidence()) from None
        return float(norm)

    def _wrong_gradients(self) -> list[str]:
        """Names of the weights whose gradients are not finite."""
        return [
            name
            for name, parameter in self.policy.named_parameters()
            if parameter.grad is not None and not parameter.grad.isfinite().all()
        ]

    def _evidence(self, rollout: Rollout, advantages: Tensor, chosen: NDArray[np.int64]) -> dict[str, Any]:
        """Of a minibatch that failed: `minibatch` does it again. The weights are those before its step."""
        return {
            "policy": self.policy.state_dict(),
            "learner": self.state_dict(),
            "shape": vars(self.policy.shape),
            "rollout": vars(rollout),
            "advantages": advantages,
            "chosen": chosen,
        }

    def _policy_loss(self, ratio: Tensor, advantages: Tensor) -> Tensor:
        clipped = ratio.clamp(1 - self.config.clip, 1 + self.config.clip)
        return -torch.min(ratio * advantages, clipped * advantages).mean()

    def _value_loss(self, values: Tensor, old_values: Tensor, returns: Tensor) -> Tensor:
        loss = (values - returns).square()
        if self.config.clip_value_loss:
            clipped = old_values + (values - old_values).clamp(-self.config.clip, self.config.clip)
            loss = torch.max(loss, (clipped - returns).square())
        return 0.5 * loss.mean()

    def state_dict(self) -> dict[str, Any]:
        return {"optimizer": self.optimizer.state_dict(), "order": self._order.bit_generator.state}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.optimizer.load_state_dict(state["optimizer"])
        for group in self.optimizer.param_groups:  # which a run that goes on may have been given anew
            group.update(lr=self.config.lr, eps=self.config.adam_eps)
        self._order.bit_generator.state = state["order"]
