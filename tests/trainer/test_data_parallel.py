"""Two workers' update is one worker's on the joined rollout, in real processes."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from tests.trainer.worker_processes import together, values
from thinknav_trainer.config import PPOConfig, TrainConfig, WarmStartConfig
from thinknav_trainer.policy import ObservationShape, Policy, Sequences
from thinknav_trainer.ppo import PPO
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.warm_start import Cloner
from thinknav_trainer.workers import Lone, Workers

CONFIG = PPOConfig(epochs=3, minibatches=1, lr=1e-2, precision="float32")
LENGTHS = ([5, 1, 9, 3], [2, 7])  # of two workers' sequences: they bring different numbers of transitions


class DoublePolicy(nn.Module):
    """As `Policy` is to PPO, in float64, where sums in another order differ by nothing that counts."""

    device = torch.device("cpu")

    def __init__(self) -> None:
        super().__init__()
        self.shape = ObservationShape(height=1, width=1, num_actions=4, thought_size=0)
        self.vision = SimpleNamespace(prepare=lambda observations: observations)
        self.rnn = nn.LSTM(3, 6)
        self.heads = nn.Linear(6, 5)
        self.unused = nn.Linear(1, 1)
        self.double()

    def sequence(
        self, observations: dict[str, Tensor], previous_actions: Tensor, sequences: Sequences
    ) -> tuple[Tensor, Tensor]:
        output, _ = self.rnn(observations["seen"][sequences.index], tuple(sequences.hidden))
        heads = self.heads(output[sequences.mask])
        return heads[:, :4], heads[:, 4]


def learner(workers: Workers = Lone(), config: PPOConfig = CONFIG) -> PPO:
    torch.manual_seed(0)
    return PPO(cast(Policy, DoublePolicy()), config, 0, workers)


def rollout(lengths: list[int], seed: int) -> Rollout:
    count = sum(lengths)
    generator = torch.Generator().manual_seed(seed)

    def normal(*size: int) -> Tensor:
        return torch.randn(*size, generator=generator, dtype=torch.float64)

    return Rollout(
        observations={"seen": normal(count, 3)},
        actions=torch.randint(0, 4, (count,), generator=generator),
        previous_actions=torch.zeros(count, dtype=torch.int64),
        log_probs=normal(count) * 0.1 - 1.4,
        values=normal(count),
        advantages=normal(count) + seed,  # another mean for each worker
        returns=normal(count),
        sequence_starts=np.cumsum(lengths) - np.array(lengths),
        sequence_lengths=np.array(lengths),
        sequence_hidden=normal(2, 1, len(lengths), 6),
    )


def joined(first: Rollout, second: Rollout) -> Rollout:
    def both(name: str, dim: int = 0) -> Any:
        return torch.cat([getattr(first, name), getattr(second, name)], dim)

    names = ("actions", "previous_actions", "log_probs", "values", "advantages", "returns")
    return Rollout(
        observations={"seen": torch.cat([first.observations["seen"], second.observations["seen"]])},
        **{name: both(name) for name in names},
        sequence_starts=np.concatenate([first.sequence_starts, second.sequence_starts + len(first)]),
        sequence_lengths=np.concatenate([first.sequence_lengths, second.sequence_lengths]),
        sequence_hidden=both("sequence_hidden", 2),
    )


def state(ppo: PPO) -> dict[str, Any]:
    """Weights, and the gradients of the last minibatch as they were clipped."""
    named = dict(ppo.policy.named_parameters())
    gradients = {name: weight.grad for name, weight in named.items() if weight.grad is not None}
    return {
        "weights": {name: weight.detach().numpy() for name, weight in named.items()},
        "gradients": {name: gradient.numpy() for name, gradient in gradients.items()},
    }


def require_same(found: dict[str, Any], wanted: dict[str, Any]) -> None:
    for kind, arrays in wanted.items():
        for name, array in arrays.items():
            np.testing.assert_allclose(found[kind][name], array, rtol=0, atol=1e-6, err_msg=f"{kind} of {name}")


def update(workers: Workers) -> tuple[dict[str, Any], dict[str, float]]:
    ppo = learner(workers)
    losses = ppo.update(rollout(LENGTHS[workers.rank], workers.rank))
    return state(ppo), losses


def clone(workers: Workers) -> tuple[dict[str, Any], dict[str, float]]:
    ppo = learner(workers)
    cloner = Cloner(ppo.policy, WarmStartConfig(), CONFIG, 0, workers)
    losses = cloner.update(rollout(LENGTHS[workers.rank], workers.rank))
    return state(ppo), losses


def one_has_nothing(workers: Workers) -> dict[str, Any]:
    """A minibatch for which the second worker has no sequence left."""
    ppo = learner(workers)
    made = rollout(LENGTHS[workers.rank], workers.rank)
    chosen = np.arange(len(LENGTHS[0])) if workers.rank == 0 else np.arange(0)
    ppo.minibatch(made, made.observations, made.advantages, chosen)
    return state(ppo)


def all_of_it(workers: Workers) -> list[Any]:
    return [update(workers), clone(workers), one_has_nothing(workers)]


def diverge(workers: Workers) -> None:
    made = rollout(LENGTHS[workers.rank], workers.rank)
    if workers.rank == 1:
        made.returns[3] = float("inf")
    learner(workers).update(made)


def test_only_whose_numbers_are_not_finite_says_so() -> None:
    first, second = together(diverge, TrainConfig())
    assert second.error is not None
    assert second.error.startswith("NotFinite: value_loss of an update")
    assert first.error == "SystemExit: 1"


@pytest.fixture(scope="module")
def found() -> list[list[Any]]:
    return values(together(all_of_it, TrainConfig()))


JOINED = joined(rollout(LENGTHS[0], 0), rollout(LENGTHS[1], 1))


@pytest.mark.parametrize("rank", [0, 1])
def test_an_update_is_that_of_the_joined_rollout(found: list[list[Any]], rank: int) -> None:
    ppo = learner()
    before = state(ppo)["weights"]["heads.weight"].copy()
    losses = ppo.update(JOINED)
    assert np.abs(state(ppo)["weights"]["heads.weight"] - before).max() > 1e-3
    require_same(found[rank][0][0], state(ppo))
    assert found[rank][0][1] == pytest.approx(losses, abs=1e-6)


@pytest.mark.parametrize("rank", [0, 1])
def test_so_it_is_while_imitating(found: list[list[Any]], rank: int) -> None:
    ppo = learner()
    losses = Cloner(ppo.policy, WarmStartConfig(), CONFIG, 0).update(JOINED)
    require_same(found[rank][1][0], state(ppo))
    assert found[rank][1][1] == pytest.approx(losses, abs=1e-6)


@pytest.mark.parametrize("rank", [0, 1])
def test_a_worker_without_a_sequence_learns_from_the_others(found: list[list[Any]], rank: int) -> None:
    ppo = learner()
    made = rollout(LENGTHS[0], 0)
    ppo.minibatch(made, made.observations, made.advantages, np.arange(len(LENGTHS[0])))
    require_same(found[rank][2], state(ppo))
