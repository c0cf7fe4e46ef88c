"""Transitions as they are collected, step by step, from envs that do not keep pace; in the end, a rollout of them.

Knows neither envs nor networks, only what they gave.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from thinknav_trainer.rollout import Rollout, cut_sequences, generalized_advantages


@dataclass(frozen=True)
class Transitions:
    """One transition of each of n envs.

    envs, actions, previous_actions: (n,) int64. observations: name -> (n, ...), before the action, and hidden
    (2, layers, n, H), the LSTM's state with them. log_probs, values: (n,) float32, as the actor had them.
    rewards: (n,) float32, with gamma x the value of the final observation where the episode was cut off.
    done: (n,) bool, an episode ended.
    """

    envs: NDArray[np.int64]
    observations: Mapping[str, NDArray[Any]]
    hidden: Tensor
    previous_actions: NDArray[np.int64]
    actions: NDArray[np.int64]
    log_probs: NDArray[np.float32]
    values: NDArray[np.float32]
    rewards: NDArray[np.float32]
    done: NDArray[np.bool_]


class TransitionLog:
    """Transitions in the order of time. Arrays that were added must not change afterwards."""

    def __init__(self) -> None:
        self._steps: list[Transitions] = []
        self._count = 0

    def __len__(self) -> int:
        """Transitions so far, of all envs."""
        return self._count

    def add(self, transitions: Transitions) -> None:
        """What some envs did at the same time."""
        self._steps.append(transitions)
        self._count += len(transitions.envs)

    def rollout(self, last_values: NDArray[np.float32], gamma: float, tau: float, chunk_length: int) -> Rollout:
        """Everything, env by env. last_values: (N,), of what each of all N envs observed after its last transition."""
        steps = self._steps
        envs = np.concatenate([step.envs for step in steps])
        order = np.argsort(envs, kind="stable")
        place = np.empty_like(order)  # of each transition in the rollout
        place[order] = np.arange(len(order))
        columns = {
            item.name: np.concatenate([getattr(step, item.name) for step in steps])[order]
            for item in fields(Transitions)
            if item.name not in ("envs", "observations", "hidden")
        }
        counts = np.bincount(envs, minlength=len(last_values))
        advantages = _advantages(columns, counts, last_values, gamma, tau)
        starts, lengths = _sequences(columns["done"], counts, chunk_length)
        when = np.repeat(np.arange(len(steps)), [len(step.envs) for step in steps])
        row = np.concatenate([np.arange(len(step.envs)) for step in steps])
        hidden = [steps[when[first]].hidden[:, :, row[first]] for first in order[starts]]
        return Rollout(
            observations=_gather(steps, place),
            actions=torch.from_numpy(columns["actions"]),
            previous_actions=torch.from_numpy(columns["previous_actions"]),
            log_probs=torch.from_numpy(columns["log_probs"]),
            values=torch.from_numpy(columns["values"]),
            advantages=torch.from_numpy(advantages),
            returns=torch.from_numpy(advantages + columns["values"]),
            sequence_starts=starts,
            sequence_lengths=lengths,
            sequence_hidden=torch.stack(hidden, dim=2),
        )


def _gather(steps: list[Transitions], place: NDArray[np.int64]) -> dict[str, Tensor]:
    """Observations of all steps, each copied once, to its place."""
    gathered = {
        name: np.empty((len(place), *values.shape[1:]), values.dtype) for name, values in steps[0].observations.items()
    }
    first = 0
    for step in steps:
        rows = place[first : first + len(step.envs)]
        for name, values in step.observations.items():
            gathered[name][rows] = values
        first += len(rows)
    return {name: torch.from_numpy(values) for name, values in gathered.items()}


def _advantages(
    columns: Mapping[str, NDArray[Any]],
    counts: NDArray[np.int64],
    last_values: NDArray[np.float32],
    gamma: float,
    tau: float,
) -> NDArray[np.float32]:
    """(M,) of transitions that lie env by env, `counts` (N,) of each.

    They are laid out so that all envs end in the last row: what fills the rows before an env's first transition comes
    later in the backward sum, and is dropped.
    """
    longest = int(counts.max())
    env = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(len(env)) - np.repeat(np.cumsum(counts), counts) + longest
    grids = {}
    for name in ("rewards", "values", "done"):
        grids[name] = np.zeros((longest, len(counts)), columns[name].dtype)
        grids[name][step, env] = columns[name]
    return generalized_advantages(grids["rewards"], grids["values"], grids["done"], last_values, gamma, tau)[step, env]


def _sequences(
    done: NDArray[np.bool_], counts: NDArray[np.int64], chunk_length: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Starts and lengths of the recurrent sequences of transitions that lie env by env."""
    ends = np.cumsum(counts)
    cuts = [
        (end - count + starts, lengths)
        for end, count in zip(ends, counts, strict=True)
        for starts, lengths in [cut_sequences(done[end - count : end], chunk_length)]
    ]
    return np.concatenate([starts for starts, _ in cuts]), np.concatenate([lengths for _, lengths in cuts])
