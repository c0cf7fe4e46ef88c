"""A policy's first lessons: it imitates a demonstrator (behaviour cloning), before it learns from rewards.

The demonstrator acts in the run's own envs, with the run's own planner, and its steps count. Meanwhile the policy looks
on: its LSTM follows what is done, and its critic learns what that is worth, so that PPO does not begin with a critic
that knows nothing, and unlearn at once what was imitated. More and more envs are the policy's own, where it is told
what the demonstrator would have done: who has only seen others do well does not know the way out of its own mistakes
(Ross et al. 2011, DAgger).
"""

import math
from collections import deque
from dataclasses import replace

import numpy as np
import torch

from thinknav_sim.observations import Observations
from thinknav_trainer.actor import Actor
from thinknav_trainer.agents import Demonstrator
from thinknav_trainer.collector import Collector, timeout_bonus
from thinknav_trainer.config import PPOConfig, WarmStartConfig
from thinknav_trainer.data_parallel import average_gradients
from thinknav_trainer.dumps import NotFinite
from thinknav_trainer.foresight import foresight_of
from thinknav_trainer.policy import Policy
from thinknav_trainer.precision import autocast
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.thoughts import Thought
from thinknav_trainer.threads import torch_threads
from thinknav_trainer.transitions import TransitionLog, Transitions
from thinknav_trainer.workers import Lone, Workers


class Demonstrations:
    """Rollouts of what a demonstrator does, all envs in lock-step. The episodes count as the collector's."""

    def __init__(
        self, env: ThinkingEnv, actor: Actor, demonstrator: Demonstrator, collector: Collector, config: PPOConfig
    ) -> None:
        self._env = env
        self._actor = actor
        self._demonstrator = demonstrator
        self._collector = collector
        self._config = config
        self._observations: Observations = env.reset()
        self._thoughts: list[Thought] = []
        actor.forget_everything()

    @torch_threads(1)
    def collect(self, own: float = 0.0) -> Rollout:
        """num_steps of each env; its actions are those that the demonstrator names, whoever acts.

        own: share of the envs in which the policy acts by itself.
        """
        log = TransitionLog()
        stopwatch = self._collector.stopwatch
        self._collector.thoughts = []
        alone = np.arange(self._env.num_envs) < round(own * self._env.num_envs)
        for _ in range(self._config.num_steps):
            with stopwatch("act"):
                looked = self._actor.look(self._observations)
                chosen = self._actor.decide(looked)
                named = self._demonstrator.actions(self._observations, self._thoughts)
            taken = np.where(alone, chosen.actions.numpy(), named)
            self._demonstrator.took(taken)
            decision = replace(chosen, actions=torch.from_numpy(taken))
            with stopwatch("step"):
                step = self._env.step(taken)
            self._collector.require_finite(np.arange(self._env.num_envs), decision, step)
            done = step.terminated | step.truncated
            log.add(
                Transitions(
                    envs=np.arange(self._env.num_envs),
                    observations=looked,
                    hidden=self._actor.hidden,
                    previous_actions=self._actor.previous.numpy(),
                    actions=named,
                    log_probs=decision.log_probs.numpy(),
                    values=decision.values.numpy(),
                    rewards=step.rewards + timeout_bonus(self._actor, step, decision, self._config.gamma),
                    done=done,
                )
            )
            self._demonstrator.ended(done)
            self._actor.advance(decision, done)
            self._collector.note(step)
            self._observations = step.observations
            self._thoughts = [thought for thought in step.thoughts if not done[thought.env]]
        looked = self._actor.look(self._observations)
        last = self._actor.values(looked, self._actor.previous, self._actor.hidden).numpy()
        return log.rollout(last, self._config.gamma, self._config.tau, self._config.chunk_length)


class Cloner:
    """Behaviour cloning on recurrent sequences, and the critic's regression to the returns of whoever acted.

    It goes through what it has just been shown, and through some of what it was shown before.
    """

    def __init__(
        self, policy: Policy, config: WarmStartConfig, ppo: PPOConfig, seed: int, workers: Workers = Lone()
    ) -> None:
        self._policy = policy
        self._config = config
        self._ppo = ppo
        self._optimizer = torch.optim.Adam(policy.parameters(), lr=config.lr, eps=ppo.adam_eps, fused=True)
        self._order = np.random.default_rng((seed, 1))
        self._workers = workers
        self._shown: deque[Rollout] = deque(maxlen=config.remembered)

    def update(self, rollout: Rollout) -> dict[str, float]:
        """A pass over a rollout and over others; means of the losses, and how often the likeliest action was right."""
        self._shown.append(rollout)
        sums: dict[str, float] = {}
        chosen = [len(self._shown) - 1, *self._order.integers(len(self._shown), size=self._config.epochs - 1)]
        for index in chosen:
            for name, value in self._pass(self._shown[index]).items():
                sums[name] = sums.get(name, 0.0) + value
        batches = self._config.epochs * self._ppo.minibatches
        return {name: total / batches for name, total in sums.items()}

    def _pass(self, rollout: Rollout) -> dict[str, float]:
        """One pass over a rollout: sums of the losses over its minibatches."""
        sums: dict[str, float] = {}
        device = self._policy.device
        rollout = rollout.to(device)
        with autocast(self._ppo.precision, device):
            observations = self._policy.vision.prepare(rollout.observations)
        order = self._order.permutation(len(rollout.sequence_starts))
        for chosen in np.array_split(order, self._ppo.minibatches):
            transitions, sequences = rollout.select(chosen)
            with autocast(self._ppo.precision, device):
                logits, values = self._policy.sequence(
                    {name: rows[transitions] for name, rows in observations.items()},
                    rollout.previous_actions[transitions],
                    sequences,
                )
            rows = transitions[sequences.index[sequences.mask]]
            actions = rollout.actions[rows]
            cloning_loss = torch.nn.functional.cross_entropy(logits, actions)
            value_loss = 0.5 * (values - rollout.returns[rows]).square().mean()
            losses = {
                "cloning_loss": cloning_loss.item(),
                "value_loss": value_loss.item(),
                "cloning_accuracy": (logits.argmax(dim=1) == actions).float().mean().item(),
            }
            loss = cloning_loss + self._ppo.value_coef * value_loss
            if self._config.foresight_coef:
                foresight_loss = foresight_of(rollout, logits, rows, sequences.mask)
                loss = loss + self._config.foresight_coef * foresight_loss
                losses["foresight_loss"] = foresight_loss.item()
            self._optimizer.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            losses = average_gradients(self._policy.parameters(), losses, len(rows), self._workers)
            norm = torch.nn.utils.clip_grad_norm_(self._policy.parameters(), self._config.max_grad_norm).item()
            wrong = [name for name, value in {**losses, "gradients": norm}.items() if not math.isfinite(value)]
            if wrong:
                raise NotFinite(f"{', '.join(wrong)} in the warm start", {})
            self._optimizer.step()
            for name, value in losses.items():
                sums[name] = sums.get(name, 0.0) + value
        return sums
