"""Thinks that a strategy forces: when they come, and that learning is told the truth about them."""

import math

import numpy as np
import pytest
import torch

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import Actor
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import NEVER, PPOConfig, TrainConfig, change_config, load_config
from thinknav_trainer.forcing import FORCED_THINK, acting_log_probs
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.strategies import agent, every_n, once

PPO_CONFIG = PPOConfig(num_steps=40, chunk_length=8, precision="float32", epochs=1, minibatches=1)


def test_the_mixture_is_a_distribution() -> None:
    log_probs = torch.randn(6, 5).log_softmax(1)
    forced = torch.tensor([0.0, 0.1, 0.5, 0.9, 1.0, 1.0])
    mixed = acting_log_probs(log_probs, forced).exp()
    torch.testing.assert_close(mixed.sum(1), torch.ones(6))
    torch.testing.assert_close(mixed[:, :4], (1 - forced)[:, None] * log_probs[:, :4].exp())
    assert torch.equal(acting_log_probs(log_probs, None), log_probs)


def test_a_certain_think_moves_no_weight_and_a_likely_one_moves_it_less() -> None:
    logits = torch.zeros(3, 5, requires_grad=True)
    forced = torch.tensor([0.0, 0.5, 1.0])
    acting_log_probs(logits.log_softmax(1), forced)[:, Action.THINK].sum().backward()  # type: ignore[no-untyped-call]
    assert logits.grad is not None
    free, half, certain = logits.grad[:, Action.THINK].tolist()
    assert free > half > certain == 0
    assert half == pytest.approx(free * 0.5 * 0.2 / (0.5 * 0.2 + 0.5))  # the share of it that was the policy's own
    assert torch.isfinite(logits.grad).all()


def test_a_policy_that_never_thinks_has_finite_gradients() -> None:
    logits = torch.tensor([[0.0, 0.0, 0.0, 0.0, NEVER]] * 2, requires_grad=True)
    log_probs = logits.log_softmax(1)
    mixed = acting_log_probs(log_probs, torch.tensor([0.0, 1.0]))
    entropy = -(log_probs.exp() * log_probs).sum()
    assert entropy.item() == pytest.approx(2 * math.log(4))
    (mixed[0, 1] + mixed[1, Action.THINK] + entropy).backward()  # type: ignore[no-untyped-call]
    assert logits.grad is not None
    assert torch.isfinite(logits.grad).all()
    assert not logits.grad[:, Action.THINK].any()


def test_strategies_say_when() -> None:
    config = load_config("smoke", overrides=["think.forced=0.4", "think.forced_until=0.5", "think.every=3"]).think
    steps = np.arange(7)
    assert agent(steps, 0.0, config) == pytest.approx(np.full(7, 0.4))
    assert agent(steps, 0.25, config) == pytest.approx(np.full(7, 0.2))
    assert not agent(steps, 0.6, config).any()
    assert every_n(steps, 0.0, config).tolist() == [1, 0, 0, 1, 0, 0, 1]
    assert once(steps, 0.0, config).tolist() == [1, 0, 0, 0, 0, 0, 0]


def collector(thinking_env: MakeThinkingEnv, smoke: TrainConfig, **think: object) -> tuple[Collector, PPO]:
    env = thinking_env(lambda request: "turn left", count=4, max_steps=12, **think)
    config = change_config(smoke, overrides=[f"think.strategy={think.get('strategy', 'agent')}"])
    torch.manual_seed(0)
    policy = Policy(ObservationShape(32, 32, num_actions=5, thought_size=512), config.network)
    return Collector(env, Actor(policy, 4, "float32", seed=0), PPO_CONFIG), PPO(policy, PPO_CONFIG)


@pytest.mark.parametrize("strategy", ["every_n", "once"])
def test_a_policy_thinks_when_its_strategy_says_so_and_never_else(
    thinking_env: MakeThinkingEnv, smoke: TrainConfig, strategy: str
) -> None:
    made, learner = collector(thinking_env, smoke, strategy=strategy, every=5)
    for _ in range(2):
        rollout = made.collect()
        thinks = rollout.actions == Action.THINK
        assert thinks.any()
        assert torch.equal(thinks, rollout.observations[FORCED_THINK] == 1)
        assert not rollout.log_probs[thinks].any()  # certain
        losses = learner.update(rollout)
        assert losses["approximate_kl"] == pytest.approx(0, abs=1e-6)


def test_forced_thinks_are_stored_with_the_probability_that_they_had(
    thinking_env: MakeThinkingEnv, smoke: TrainConfig
) -> None:
    made, learner = collector(thinking_env, smoke, forced=0.5)
    made._env.share = 0.0
    made.collect()
    made._env.share = 0.25  # of the run: the probability has halved, for all but what was seen before
    rollout = made.collect()
    assert rollout.observations[FORCED_THINK].mean() == pytest.approx(0.25, abs=0.02)
    thinks = rollout.actions == Action.THINK
    assert 0.25 < thinks.float().mean() < 0.6  # a fifth of what is left is the policy's own
    assert rollout.log_probs[thinks].exp().min() > 0.25
    losses = learner.update(rollout)
    assert losses["approximate_kl"] == pytest.approx(0, abs=1e-6)


def test_nothing_is_forced_once_the_run_is_over(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(lambda request: "turn left", forced=0.5)
    assert not env.reset()[FORCED_THINK].any()
    assert FORCED_THINK not in thinking_env(lambda request: "turn left").reset()
