"""Transitions between two updates, and what learning needs of them: advantages and recurrent sequences.

Transitions of one env lie one after the other, and envs follow one another; an env may give any number of them.
Knows nothing of networks and simulators.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from thinknav_trainer.policy import Sequences

# What the numbers of transitions and of sequences in a minibatch are filled up to multiples of.
TRANSITIONS_STEP, SEQUENCES_STEP = 64, 8


@dataclass(frozen=True)
class Rollout:
    """M transitions.

    observations: what the policy kept of them, name -> (M, ...). actions, previous_actions: (M,) int64.
    log_probs, values, advantages, returns: (M,).
    sequence_starts, sequence_lengths: (S,) int64, into the M transitions; no sequence crosses an episode's end.
    sequence_hidden: (2, layers, S, H), the LSTM's state before each sequence.
    """

    observations: dict[str, Tensor]
    actions: Tensor
    previous_actions: Tensor
    log_probs: Tensor
    values: Tensor
    advantages: Tensor
    returns: Tensor
    sequence_starts: NDArray[np.int64]
    sequence_lengths: NDArray[np.int64]
    sequence_hidden: Tensor

    def __len__(self) -> int:
        return len(self.actions)

    def to(self, device: torch.device) -> "Rollout":
        """The same on a device; itself where it is there already. What says how it falls into sequences stays."""
        if self.actions.device == device:
            return self
        return Rollout(
            observations={name: values.to(device) for name, values in self.observations.items()},
            actions=self.actions.to(device),
            previous_actions=self.previous_actions.to(device),
            log_probs=self.log_probs.to(device),
            values=self.values.to(device),
            advantages=self.advantages.to(device),
            returns=self.returns.to(device),
            sequence_starts=self.sequence_starts,
            sequence_lengths=self.sequence_lengths,
            sequence_hidden=self.sequence_hidden.to(device),
        )

    def select(self, chosen: NDArray[np.int64]) -> tuple[Tensor, Sequences]:
        """The transitions of some sequences (B,) and how the policy should lay them out.

        Both are filled up with repetitions that `mask` leaves out, so that there are few sizes of either: a processor's
        matrix products are compiled anew for each.

        The sequences' index counts within these transitions: `transitions[index[mask]]` has each one once.
        """
        starts, lengths = self.sequence_starts[chosen], self.sequence_lengths[chosen]
        filled = np.append(chosen, np.repeat(chosen[:1], -len(chosen) % SEQUENCES_STEP))
        steps = np.arange(int(lengths.max()))[:, None]
        offsets = np.concatenate([[0], np.cumsum(lengths)[:-1]])
        index = np.zeros((len(steps), len(filled)), np.int64)
        mask = np.zeros(index.shape, np.bool_)
        index[:, : len(chosen)] = offsets + np.minimum(steps, lengths - 1)
        mask[:, : len(chosen)] = steps < lengths
        transitions = np.concatenate([np.arange(s, s + n) for s, n in zip(starts, lengths, strict=True)])
        transitions = np.append(transitions, np.repeat(transitions[:1], -len(transitions) % TRANSITIONS_STEP))
        sequences = Sequences(
            torch.from_numpy(index),
            torch.from_numpy(mask),
            self.sequence_hidden[:, :, torch.from_numpy(filled)],
        )
        return torch.from_numpy(transitions), sequences


def generalized_advantages(
    rewards: NDArray[np.float32],
    values: NDArray[np.float32],
    done: NDArray[np.bool_],
    last_values: NDArray[np.float32],
    gamma: float,
    tau: float,
) -> NDArray[np.float32]:
    """GAE (Schulman et al. 2016) over lock-step arrays (T, N).

    done cuts the sum; the reward of a truncated step must already hold gamma x the value of its final observation.
    last_values: (N,) values after the last step.
    """
    advantages = np.zeros_like(rewards)
    next_advantage = np.zeros_like(last_values)
    next_values = last_values
    for t in reversed(range(len(rewards))):
        goes_on = ~done[t]
        delta = rewards[t] + gamma * next_values * goes_on - values[t]
        next_advantage = delta + gamma * tau * goes_on * next_advantage
        advantages[t] = next_advantage
        next_values = values[t]
    return advantages


def cut_sequences(done: NDArray[np.bool_], chunk_length: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where recurrent sequences begin, for one env's T transitions: (starts, lengths).

    done: (T,). A sequence begins at 0, at every multiple of chunk_length, and after each done.
    """
    steps = np.arange(len(done))
    begins = steps % chunk_length == 0
    begins[1:] |= done[:-1]
    starts = np.flatnonzero(begins).astype(np.int64)
    return starts, np.diff(np.append(starts, len(done)))
