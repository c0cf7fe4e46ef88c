"""Learning in turn and beside collecting: each rollout once, and who acts by which weights."""

import threading
from collections.abc import Iterator

import pytest
import torch

from tests.trainer.test_ppo import bandit_rollout, learner
from thinknav_trainer.dumps import NotFinite
from thinknav_trainer.learning import Beside, InTurn
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.threads import torch_threads
from thinknav_trainer.timing import Stopwatch

WEIGHT = "actor.weight"


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Sums come out otherwise with another number of threads, and beside there is one."""
    with torch_threads(1):
        yield


def test_in_turn_the_losses_are_those_of_the_rollout() -> None:
    ppo, other = learner(), learner()
    learning = InTurn(ppo, Stopwatch())
    rollout, losses = learning.improve(lambda: bandit_rollout(ppo, 0), 1.0)
    assert losses == other.update(rollout)
    assert learning.acting is ppo.policy
    learning.settle()
    assert torch.equal(ppo.policy.state_dict()[WEIGHT], other.policy.state_dict()[WEIGHT])


def test_beside_each_rollout_is_learnt_from_once_one_behind() -> None:
    ppo, reference = learner(), learner()
    rollouts = [bandit_rollout(reference, seed) for seed in range(3)]
    learning = Beside(ppo, Stopwatch())
    told = [learning.improve(lambda rollout=rollout: rollout, 1.0) for rollout in rollouts]  # type: ignore[misc]
    assert [rollout for rollout, _ in told] == rollouts
    learning.settle()
    learning.settle()  # there is nothing left
    expected = [reference.update(rollout) for rollout in rollouts]
    assert [losses for _, losses in told] == [{}, *expected[:2]]
    _, losses = learning.improve(lambda: rollouts[0], 1.0)
    assert losses == expected[2]
    assert torch.equal(ppo.policy.state_dict()[WEIGHT], reference.policy.state_dict()[WEIGHT])


def test_beside_a_rollout_is_learnt_from_at_the_share_that_was_left_when_it_was_collected() -> None:
    """One rollout later, the last one's would be below zero."""
    ppo = learner()
    learning = Beside(ppo, Stopwatch())
    shares = []
    update = ppo.update

    def noted(rollout: Rollout, remaining: float = 1.0) -> dict[str, float]:
        shares.append(remaining)
        return update(rollout, remaining)

    ppo.update = noted  # type: ignore[method-assign]
    for remaining in (1.0, 0.6, 0.2):
        learning.improve(lambda: bandit_rollout(ppo, 0), remaining)
    learning.settle()
    assert shares == [1.0, 0.6, 0.2]


def test_beside_one_acts_by_the_weights_from_before() -> None:
    ppo = learner()
    learning = Beside(ppo, Stopwatch())
    assert learning.acting is not ppo.policy
    learning.improve(lambda: bandit_rollout(ppo, 0), 1.0)
    before = learning.acting.state_dict()[WEIGHT].clone()
    collected = threading.Event()
    update = ppo.update

    def slow(rollout: Rollout, remaining: float = 1.0) -> dict[str, float]:
        losses = update(rollout, remaining)
        assert collected.wait(30)
        return losses

    ppo.update = slow  # type: ignore[method-assign]

    def collect() -> Rollout:
        rollout = bandit_rollout(learner(), 1)
        assert torch.equal(learning.acting.state_dict()[WEIGHT], before)
        collected.set()
        return rollout

    learning.improve(collect, 1.0)
    assert not torch.equal(learning.acting.state_dict()[WEIGHT], before)
    assert torch.equal(learning.acting.state_dict()[WEIGHT], ppo.policy.state_dict()[WEIGHT])


def test_what_is_not_finite_is_told_by_the_next_call() -> None:
    ppo = learner()
    learning = Beside(ppo, Stopwatch())
    rollout = bandit_rollout(ppo, 0)
    rollout.advantages[3] = torch.nan
    learning.improve(lambda: rollout, 1.0)
    with pytest.raises(NotFinite, match="policy_loss"):
        learning.improve(lambda: rollout, 1.0)
