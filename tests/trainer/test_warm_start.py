"""A policy that imitates: whom, for how long, and that it comes to do the same."""

from pathlib import Path

import pytest
import torch

from tests.trainer.conftest import MakeThinkingEnv
from tests.trainer.obeying import ThinkAndObey
from thinknav_proto import SubgoalRequest
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import Actor
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import ConfigError, PPOConfig, TrainConfig, WarmStartConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.run import Run, list_checkpoints, read_metrics
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import train
from thinknav_trainer.warm_start import Cloner, Demonstrations

CONFIG = PPOConfig(num_steps=16, chunk_length=8, precision="float32")


def turns(request: SubgoalRequest) -> str:
    return ("turn left", "turn right")[int(request.request_id) % 2]


def test_a_policy_learns_to_read_thoughts_by_imitating(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    env = thinking_env(turns, count=4, max_steps=30)
    torch.manual_seed(0)
    policy = Policy(ObservationShape(32, 32, num_actions=5, thought_size=512), smoke.policy)
    actor = Actor(policy, 4, "float32", seed=0)
    collector = Collector(env, actor, CONFIG)
    shown = Demonstrations(env, actor, ThinkAndObey(4), collector, CONFIG)
    cloner = Cloner(policy, WarmStartConfig(lr=5e-3, epochs=4), CONFIG, seed=0)
    losses = [cloner.update(shown.collect()) for _ in range(8)]
    assert losses[0]["cloning_accuracy"] < 0.8
    assert losses[-1]["cloning_accuracy"] > 0.95  # left or right, as the thought says
    assert losses[-1]["value_loss"] < losses[0]["value_loss"]
    assert collector.episodes_ended == 4 * (8 * 16 // 30)
    assert env.counts.asked == 8 * 16 * 4 // 2


def test_demonstrations_are_whole_transitions(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    env = thinking_env(turns, count=2, max_steps=5)
    torch.manual_seed(0)
    policy = Policy(ObservationShape(32, 32, num_actions=5, thought_size=512), smoke.policy)
    actor = Actor(policy, 2, "float32", seed=0)
    rollout = Demonstrations(env, actor, ThinkAndObey(2), Collector(env, actor, CONFIG), CONFIG).collect()
    actions = rollout.actions.reshape(2, 16)
    expected = [Action.THINK, Action.TURN_LEFT] * 2 + [Action.THINK]  # or right; five steps an episode
    thinks = [action == Action.THINK for action in (expected * 4)[:16]]
    assert (actions == Action.THINK).tolist() == [thinks, thinks]
    previous = rollout.previous_actions.reshape(2, 16)
    assert (previous[:, ::5] == -1).all()
    assert torch.equal(previous[:, 1:5], actions[:, :4])
    for column, start in enumerate(rollout.sequence_starts):
        assert rollout.sequence_hidden[:, :, column].any() == (start % 16 % 5 != 0)


def test_its_steps_count_and_ppo_goes_on(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    for latency, mode in ((0.0, "true"), (0.005, "false")):
        folder = tmp_path / mode
        config = change_config(smoke, overrides=["warm_start.steps=128", f"deterministic={mode}"])
        run = Run.create(folder, config)
        last = Checkpoint.load(train(run, homes, PlannerClient(MockTransport(turns, latency)), Interruption()))
        run.close()
        rows = read_metrics(folder)
        cloned = ["losses/cloning_loss" in row for row in rows]
        assert cloned == [True] * 2 + [False] * (len(rows) - 2)
        assert [row["steps"] for row in rows[:2]] == [64, 128]
        assert last.steps == rows[-1]["steps"] >= 256
        assert Checkpoint.load(list_checkpoints(folder)[1]).steps == 128
        counts = last.state["collector"]["env"]["counts"]
        assert counts["asked"] == counts["answered"] >= 32


def test_the_planner_shows_policies_that_think(smoke: TrainConfig) -> None:
    with pytest.raises(ConfigError, match=r"needs think\.strategy agent, not never"):
        change_config(smoke, overrides=["warm_start.steps=64", "think.strategy=never"])


@pytest.mark.parametrize("demonstrator", ["bump-walker", "planner-aside"])
def test_a_policy_that_never_thinks_may_imitate_who_shows_no_thinks(
    tmp_path: Path, smoke: TrainConfig, homes: Homes, demonstrator: str
) -> None:
    quiet = ["warm_start.steps=64", "think.strategy=never", f"warm_start.demonstrator={demonstrator}"]
    run = Run.create(tmp_path / "run", change_config(smoke, overrides=quiet))
    train(run, homes, None, Interruption())
    run.close()
    rows = read_metrics(tmp_path / "run")
    assert ["losses/cloning_loss" in row for row in rows] == [True] + [False] * (len(rows) - 1)
