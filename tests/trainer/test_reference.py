"""The policy that looks on: it follows every agent as the actor does, stays as it was, and holds its pupil."""

import copy
from pathlib import Path

import numpy as np
import pytest
import torch

from tests.trainer.conftest import MakeThinkingEnv
from tests.trainer.test_collector import turn_left
from tests.trainer.test_ppo import CONFIG as BANDIT
from tests.trainer.test_ppo import bandit_rollout, learner
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import Actor
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import ConfigError, PPOConfig, TrainConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.reference import REFERENCE, Reference, divergence
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.run import Run, list_checkpoints, read_metrics
from thinknav_trainer.scenes import Homes
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.train import train

CONFIG = PPOConfig(num_steps=24, chunk_length=4, precision="float32", kl_coef=0.1)


def collecting(env: ThinkingEnv, smoke: TrainConfig) -> tuple[Collector, Policy]:
    """A collector that has been taught, and the policy that acts."""
    torch.manual_seed(0)
    policy = Policy(ObservationShape(smoke.env.height, smoke.env.width, num_actions=5, thought_size=512), smoke.policy)
    actor = Actor(policy, env.num_envs, "float32", seed=0)
    collector = Collector(env, actor, CONFIG, reference=Reference(policy, env.num_envs, "float32"))
    collector.restart(policy)
    return collector, policy


def acting_log_probs(rollout: Rollout) -> torch.Tensor:
    """(M,) what the reference gives to the actions that were taken."""
    return rollout.observations[REFERENCE].gather(1, rollout.actions[:, None])[:, 0]


@pytest.mark.parametrize("latency", [0.0, 0.003])
def test_it_follows_each_agent_as_the_policy_does(
    thinking_env: MakeThinkingEnv, smoke: TrainConfig, latency: float
) -> None:
    """As long as the weights are the same: over thinks, parked agents, the ends of episodes and those of rollouts."""
    env = thinking_env(turn_left, count=4, max_steps=7, latency=latency)
    collector, _ = collecting(env, smoke)
    for _ in range(3):
        rollout = collector.collect()
        assert (rollout.actions == Action.THINK).any()
        torch.testing.assert_close(acting_log_probs(rollout), rollout.log_probs, rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(rollout.observations[REFERENCE].exp().sum(1), torch.ones(len(rollout)))


def test_it_stays_as_it_was_when_its_pupil_learns(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    # Episodes end where the rollout does.
    collector, policy = collecting(thinking_env(turn_left, count=4, max_steps=8), smoke)
    collector.collect()
    state = collector.state_dict()
    with torch.no_grad():
        policy.actor.bias[Action.TURN_LEFT] += 3
    rollout = collector.collect()
    assert (acting_log_probs(rollout) - rollout.log_probs).abs().min() > 0.01
    collector.load_state_dict(state)
    again = collector.collect()
    assert torch.equal(again.observations[REFERENCE], rollout.observations[REFERENCE])
    joining, _ = collecting(thinking_env(turn_left, count=4, max_steps=8), smoke)  # acts as the pupil did at first
    joining.restart(policy)
    joining.adopt_reference(state)
    joined = joining.collect()
    torch.testing.assert_close(acting_log_probs(joined), joined.log_probs, rtol=1e-4, atol=1e-5)
    collector.restart(policy)
    taught_anew = collector.collect()
    torch.testing.assert_close(acting_log_probs(taught_anew), taught_anew.log_probs, rtol=1e-4, atol=1e-5)


def test_the_divergence_is_kullback_and_leiblers() -> None:
    reference = torch.tensor([[0.5, 0.25, 0.25], [1 - 2e-9, 1e-9, 1e-9]]).log()
    policy = torch.tensor([[0.25, 0.5, 0.25], [0.5, 0.25, 0.25]]).log()
    expected = [0.5 * np.log(2) + 0.25 * np.log(0.5), np.log(2)]
    assert divergence(policy, reference).item() == pytest.approx(np.mean(expected), abs=1e-6)
    assert divergence(policy, policy).item() == pytest.approx(0, abs=1e-7)


def test_who_pays_for_diverging_diverges_less() -> None:
    """By rewards alone the policy learns which action pays; for a high price it goes on as it was taught."""
    found = {}
    for kl_coef in (0.0, 100.0):
        ppo = learner(BANDIT.model_copy(update={"kl_coef": kl_coef}))
        taught = copy.deepcopy(ppo.policy)
        for seed in range(40):
            rollout = bandit_rollout(ppo, seed)
            with torch.no_grad():
                logits, _, _ = taught.step(rollout.observations, rollout.previous_actions, taught.initial_hidden(64))
            rollout.observations[REFERENCE] = logits.log_softmax(1)
            losses = ppo.update(rollout)
        found[kl_coef] = bandit_rollout(ppo, 99).returns.mean().item()
        assert ("reference_kl" in losses) == (kl_coef > 0)
    assert losses["reference_kl"] < 0.01
    assert found[0.0] > 0.9
    assert found[100.0] < 0.5


def test_a_run_keeps_to_what_it_was_taught_and_can_be_resumed(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    overrides = ["warm_start.steps=128", "ppo.kl_coef=0.5", "deterministic=true", "checkpoint_every=64"]
    config = change_config(smoke, overrides=overrides)
    with PlannerClient(MockTransport(turn_left, 0.0)) as planner:
        run = Run.create(tmp_path / "whole", config)
        whole = Checkpoint.load(train(run, homes, planner, Interruption()))
        run.close()
        middle = next(
            path
            for path in list_checkpoints(tmp_path / "whole")
            if Checkpoint.load(path).steps not in (0, 128, whole.steps)
        )
        run = Run.create(tmp_path / "resumed", config)
        resumed = Checkpoint.load(train(run, homes, planner, Interruption(), Checkpoint.load(middle)))
        run.close()
    rows = read_metrics(tmp_path / "whole")
    after = [row["losses/reference_kl"] for row in rows if row["steps"] > 128]
    assert after
    assert all(0 <= apart < 0.1 for apart in after)
    for name, weights in whole.policy.items():
        if isinstance(weights, torch.Tensor):
            assert torch.equal(weights, resumed.policy[name]), name


def test_there_is_nothing_to_keep_to_without_a_warm_start(smoke: TrainConfig) -> None:
    with pytest.raises(ConfigError, match=r"ppo.kl_coef .* needs warm_start.steps"):
        change_config(smoke, overrides=["ppo.kl_coef=0.1"])
