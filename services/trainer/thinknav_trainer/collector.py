"""Collects rollouts: act, step, remember. All agents move in lock-step; those that think are asked about together.

Knows the actor and the thinking env; nothing of losses and files.
"""

from collections import deque
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from thinknav_sim.observations import Observations
from thinknav_trainer.actor import Actor, Decision
from thinknav_trainer.config import PPOConfig
from thinknav_trainer.rollout import Rollout, cut_sequences, generalized_advantages
from thinknav_trainer.thinking import EpisodeEnd, Step, ThinkingEnv, Thought
from thinknav_trainer.timing import Stopwatch

RECENT_EPISODES = 100


class Collector:
    """Steps the envs with the policy and remembers the transitions.

    recent: the episodes that ended last. thoughts: those of the last rollout. stopwatch: where the time went.
    """

    def __init__(self, env: ThinkingEnv, actor: Actor, config: PPOConfig) -> None:
        self.recent: deque[EpisodeEnd] = deque(maxlen=RECENT_EPISODES)
        self.episodes_ended = 0
        self.thoughts: list[Thought] = []
        self.stopwatch = Stopwatch()
        self._env = env
        self._actor = actor
        self._config = config
        self._observations: Observations = actor.look(env.reset())

    def collect(self) -> Rollout:
        """num_steps of each env. Raises Unavailable when the planner has been gone too long."""
        self.thoughts = []
        shape = (self._config.num_steps, self._env.num_envs)
        rewards, values, log_probs = (np.zeros(shape, np.float32) for _ in range(3))
        done = np.zeros(shape, bool)
        actions, previous = (np.zeros(shape, np.int64) for _ in range(2))
        observations: list[Observations] = []
        hidden: list[Tensor] = []
        for t in range(self._config.num_steps):
            observations.append(self._observations)
            hidden.append(self._actor.hidden)
            previous[t] = self._actor.previous.numpy()
            with self.stopwatch("act"):
                decision = self._actor.decide(self._observations)
            actions[t], values[t], log_probs[t] = (
                part.numpy() for part in (decision.actions, decision.values, decision.log_probs)
            )
            with self.stopwatch("step"):
                step = self._env.step(actions[t])
            rewards[t] = step.rewards + self._bootstrap(step, decision)
            done[t] = step.terminated | step.truncated
            self._advance(step, decision, done[t])
        last_values = self._actor.values(self._observations, self._actor.previous, self._actor.hidden).numpy()
        advantages = generalized_advantages(rewards, values, done, last_values, self._config.gamma, self._config.tau)
        starts, lengths, sequence_hidden = self._sequences(done, hidden)
        return Rollout(
            observations={
                name: torch.from_numpy(np.stack([step[name] for step in observations], axis=1)).flatten(0, 1)
                for name in observations[0]
            },
            actions=_env_major(actions),
            previous_actions=_env_major(previous),
            log_probs=_env_major(log_probs),
            values=_env_major(values),
            advantages=_env_major(advantages),
            returns=_env_major(advantages + values),
            sequence_starts=starts,
            sequence_lengths=lengths,
            sequence_hidden=sequence_hidden,
        )

    def _bootstrap(self, step: Step, decision: Decision) -> NDArray[np.float32]:
        """gamma x value of the final observation where an episode ran out of steps: time is no state of the task."""
        bonus = np.zeros(self._env.num_envs, np.float32)
        timed_out = np.flatnonzero(step.truncated & ~step.terminated)
        if len(timed_out):
            final = [step.final_observations[int(env)] for env in timed_out]
            stacked = {name: np.stack([observation[name] for observation in final]) for name in final[0]}
            rows = torch.from_numpy(timed_out)
            final_values = self._actor.values(stacked, decision.actions[rows], decision.hidden[:, :, rows])
            bonus[timed_out] = self._config.gamma * final_values.numpy()
        return bonus

    def _advance(self, step: Step, decision: Decision, done: NDArray[np.bool_]) -> None:
        self._observations = self._actor.look(step.observations)
        self._actor.advance(decision, done)
        self.recent.extend(step.ended)
        self.episodes_ended += len(step.ended)
        self.thoughts.extend(step.thoughts)

    def _sequences(
        self, done: NDArray[np.bool_], hidden: list[Tensor]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Tensor]:
        steps, num_envs = done.shape
        cuts = [cut_sequences(done[:, env], self._config.chunk_length) for env in range(num_envs)]
        states = [hidden[t][:, :, env] for env, (starts, _) in enumerate(cuts) for t in starts.tolist()]
        all_starts = np.concatenate([env * steps + starts for env, (starts, _) in enumerate(cuts)])
        all_lengths = np.concatenate([lengths for _, lengths in cuts])
        return all_starts, all_lengths, torch.stack(states, dim=2)

    def state_dict(self) -> dict[str, Any]:
        """All that the next rollout depends on, but for the policy's weights."""
        return {
            "env": self._env.state_dict(),
            "actor": self._actor.state_dict(),
            "observations": dict(self._observations),
            "recent": [vars(end) for end in self.recent],
            "episodes_ended": self.episodes_ended,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on exactly where `state_dict` was taken."""
        self._env.load_state_dict(state["env"])
        self._actor.load_state_dict(state["actor"])
        self._observations = dict(state["observations"])
        self.recent = deque((EpisodeEnd(**end) for end in state["recent"]), maxlen=RECENT_EPISODES)
        self.episodes_ended = state["episodes_ended"]


def _env_major(array: NDArray[Any]) -> Tensor:
    """(T, N) in time to (N * T,), one env after the other."""
    return torch.from_numpy(np.ascontiguousarray(array.T)).flatten()
