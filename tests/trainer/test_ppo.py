"""The learner on a problem small enough to solve, and its guards."""

import dataclasses

import numpy as np
import pytest
import torch

from thinknav_trainer.config import PolicyConfig, PPOConfig
from thinknav_trainer.dumps import NotFinite
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.rollout import Rollout

CONFIG = PPOConfig(lr=3e-3, minibatches=2, precision="float32", normalize_advantages=False)


def learner(config: PPOConfig = CONFIG) -> PPO:
    torch.manual_seed(0)
    shape = ObservationShape(height=16, width=16, num_actions=4, thought_size=0)
    return PPO(Policy(shape, PolicyConfig(channels=(2, 2, 2), visual_size=8, hidden_size=16, stop_bias=0.0)), config)


def bandit_rollout(ppo: PPO, seed: int) -> Rollout:
    """64 one-step episodes: action = goal category (of four) pays 1, any other 0."""
    count = 64
    generator = torch.Generator().manual_seed(seed)
    goals = torch.randint(0, 4, (count, 1), generator=generator)
    observations = {
        "rgb": torch.zeros(count, 16, 16, 3, dtype=torch.uint8),
        "depth": torch.zeros(count, 16, 16, 1),
        "gps": torch.zeros(count, 2),
        "moved": torch.zeros(count, 1),
        "compass": torch.zeros(count, 1),
        "objectgoal": goals,
    }
    previous = torch.full((count,), -1)
    with torch.no_grad():
        logits, values, _ = ppo.policy.step(observations, previous, ppo.policy.initial_hidden(count))
    actions = torch.multinomial(logits.softmax(1), 1, generator=generator)
    rewards = (actions == goals)[:, 0].float()
    return Rollout(
        observations=observations,
        actions=actions[:, 0],
        previous_actions=previous,
        log_probs=logits.log_softmax(1).gather(1, actions)[:, 0],
        values=values,
        advantages=rewards - values,
        returns=rewards,
        sequence_starts=np.arange(count),
        sequence_lengths=np.ones(count, np.int64),
        sequence_hidden=ppo.policy.initial_hidden(count),
    )


def test_it_learns_which_action_pays_for_which_goal() -> None:
    ppo = learner()
    first = bandit_rollout(ppo, 0).returns.mean()
    for seed in range(60):
        losses = ppo.update(bandit_rollout(ppo, seed))
    last = bandit_rollout(ppo, 99).returns.mean()
    assert first < 0.5
    assert last > 0.9
    assert losses["entropy"] < 1.0


def test_the_first_minibatch_has_ratio_one() -> None:
    ppo = learner(CONFIG.model_copy(update={"epochs": 1, "minibatches": 1}))
    losses = ppo.update(bandit_rollout(ppo, 0))
    assert losses["approximate_kl"] == pytest.approx(0, abs=1e-6)
    assert losses["clip_fraction"] == 0


def test_the_learning_rate_decays_to_what_is_left() -> None:
    ppo = learner(CONFIG.model_copy(update={"lr_decay": True}))
    ppo.update(bandit_rollout(ppo, 0), remaining=0.25)
    assert ppo.optimizer.param_groups[0]["lr"] == pytest.approx(0.25 * CONFIG.lr)


def test_a_loss_that_is_not_finite_stops_it() -> None:
    ppo = learner()
    rollout = bandit_rollout(ppo, 0)
    rollout.returns[3] = float("nan")
    before = [parameter.clone() for parameter in ppo.policy.parameters()]
    with pytest.raises(NotFinite, match="value_loss"):
        ppo.update(rollout)
    changed = [not torch.equal(a, b) for a, b in zip(before, ppo.policy.parameters(), strict=True)]
    # A minibatch without the bad transition may have gone before; a NaN never reaches the weights.
    assert all(torch.isfinite(parameter).all() for parameter in ppo.policy.parameters()), changed


def test_sequences_of_any_length_are_compared_with_their_own_actions() -> None:
    """Without an update every ratio is one, whatever the sequences' lengths and order."""
    ppo = learner(CONFIG.model_copy(update={"epochs": 1, "minibatches": 1}))
    made = bandit_rollout(ppo, 0)
    lengths = np.array([5, 1, 9, 16, 2, 16, 15])
    assert lengths.sum() == len(made)
    starts = np.cumsum(lengths) - lengths
    log_probs, values = torch.empty(len(made)), torch.empty(len(made))
    with torch.no_grad():
        for start, length in zip(starts, lengths, strict=True):
            hidden = ppo.policy.initial_hidden(1)
            for t in range(start, start + length):
                seen = {name: value[t : t + 1] for name, value in made.observations.items()}
                logits, value, hidden = ppo.policy.step(seen, made.previous_actions[t : t + 1], hidden)
                log_probs[t], values[t] = logits.log_softmax(1)[0, made.actions[t]], value[0]
    rollout = dataclasses.replace(
        made,
        log_probs=log_probs,
        values=values,
        returns=values,
        sequence_starts=starts,
        sequence_lengths=lengths,
        sequence_hidden=ppo.policy.initial_hidden(len(lengths)),
    )
    losses = ppo.update(rollout)
    assert losses["approximate_kl"] == pytest.approx(0, abs=1e-9)
    assert losses["value_loss"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("ratio", "advantage", "loss"), [(1.5, 1.0, -1.2), (0.5, 1.0, -0.5), (1.5, -1.0, 1.5), (0.5, -1.0, 0.8)]
)
def test_the_ratio_is_clipped_only_where_that_is_pessimistic(ratio: float, advantage: float, loss: float) -> None:
    found = learner()._policy_loss(torch.tensor([ratio]), torch.tensor([advantage]))
    assert found.item() == pytest.approx(loss)


def test_value_clipping_limits_the_change() -> None:
    ppo = learner()
    loss = ppo._value_loss(torch.tensor([1.0]), torch.tensor([0.0]), torch.tensor([1.0]))
    assert loss.item() == pytest.approx(0.5 * 0.8**2)  # the clipped estimate 0.2 is the worse one
