"""A whole run, small: what it leaves on disk, and that one which was resumed equals one which was not."""

import json
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest
import torch

from thinknav_proto import PlannerError, SubgoalReply, SubgoalRequest, Unavailable
from thinknav_trainer.checkpoint import Checkpoint, CheckpointError
from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.evaluate import evaluate, is_of_own_share, read_evaluation, summarize, write_evaluation
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.policy import Policy
from thinknav_trainer.run import BEST, Run, list_checkpoints, read_log, read_metrics
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.thinking import EpisodeEnd
from thinknav_trainer.train import observation_shape, train

FLOAT32 = ("ppo.precision=float32", "policy.stop_bias=-1")


def planner() -> PlannerClient:
    return PlannerClient(MockTransport(lambda request: ("turn left", "move forward")[int(request.request_id) % 2]))


def config_of(smoke: TrainConfig, *overrides: str) -> TrainConfig:
    return change_config(smoke, overrides=["deterministic=true", *FLOAT32, *overrides])


def test_a_run_leaves_metrics_thoughts_and_checkpoints(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = config_of(smoke)
    run = Run.create(tmp_path, config)
    last = train(run, homes, planner(), Interruption())
    run.close()
    assert [path.stem for path in list_checkpoints(tmp_path)] == ["0000000000", "0000000128", "0000000256"]
    assert last == list_checkpoints(tmp_path)[-1]
    metrics = read_metrics(tmp_path)
    assert [row["steps"] for row in metrics] == [64, 128, 192, 256]
    asked = [json.loads(line) for line in (tmp_path / "thoughts.jsonl").read_text().splitlines()]
    assert len(asked) == metrics[-1]["thoughts/asked"] == metrics[-1]["thoughts/answered"] > 0
    assert {"success", "spl", "soft_spl", "think_rate", "reward/think_cost"} <= set(metrics[-1])
    assert {"time/act", "time/step", "time/learn", "steps_per_s"} <= set(read_log(tmp_path / "timing.jsonl")[-1])
    # With the task alone each episode's terms add up; thinking is charged by the think.
    assert metrics[-1]["reward/think_cost"] == pytest.approx(-0.01 * metrics[-1]["thinks"], abs=1e-6)


def test_a_resumed_run_equals_one_that_was_not_interrupted(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = config_of(smoke, "think.budget=0.1", "think.dropout=0.3", "policy.obstacle_memory=true")
    whole = Run.create(tmp_path / "whole", config)
    train(whole, homes, planner(), Interruption())
    whole.close()
    first = Run.create(tmp_path / "halves", change_config(config, overrides=["total_steps=128"]))
    middle = train(first, homes, planner(), Interruption())
    first.close()
    second = Run(tmp_path / "halves", config, steps=128)
    train(second, homes, planner(), Interruption(), resume_from=Checkpoint.load(middle))
    second.close()
    a, b = (Checkpoint.load(list_checkpoints(tmp_path / name)[-1]) for name in ("whole", "halves"))
    for name, weight in a.policy.items():
        assert torch.equal(weight, b.policy[name]), name
    prices = [row["think_price"] for row in read_metrics(tmp_path / "halves")]
    assert prices[2] != prices[1] != 0.01
    for log in ("metrics", "thoughts", "embeddings"):
        texts = {(tmp_path / name / f"{log}.jsonl").read_text() for name in ("whole", "halves")}
        assert len(texts) == 1, log


def test_thinks_are_charged_at_the_price_that_keeps_the_budget(
    tmp_path: Path, smoke: TrainConfig, homes: Homes
) -> None:
    run = Run.create(tmp_path, config_of(smoke, "think.budget=0.01", "think.budget_lr=1", "think.budget_after=0.3"))
    last = Checkpoint.load(train(run, homes, planner(), Interruption()))
    run.close()
    rows = read_metrics(tmp_path)
    # Two updates before 0.3 of the run leave it alone; what the others set is charged from the next rollout on.
    assert [row["think_price"] for row in rows] == pytest.approx([0.01, 0.01, 1.01, 2.01])
    assert last.state["price"] == {"now": pytest.approx(2.01)}
    assert rows[1]["reward/think_cost"] == pytest.approx(-0.01 * rows[1]["thinks"], abs=1e-6)
    assert rows[3]["reward/think_cost"] < -0.1 * rows[3]["thinks"]


def test_a_run_that_does_not_wait_counts_each_step_and_thought_once(
    tmp_path: Path, smoke: TrainConfig, homes: Homes
) -> None:
    """Stopped while thoughts were under way, and resumed."""
    config = change_config(
        smoke, overrides=["deterministic=false", *FLOAT32, "policy.think_bias=2", "think.deadline=600"]
    )
    held, first_ended = threading.Event(), threading.Event()

    class HoldsOneBack(MockTransport):
        """The first request that travels alone is answered when the first run has ended. Others would wait with it."""

        def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
            if len(requests) == 1 and not held.is_set():
                held.set()
                first_ended.wait(300)
            return super().ask(requests)

    slow = PlannerClient(HoldsOneBack(lambda request: "turn left", latency=0.005))
    first = Run.create(tmp_path, change_config(config, overrides=["total_steps=128"]))
    middle = Checkpoint.load(train(first, homes, slow, Interruption()))
    first.close()
    first_ended.set()
    assert held.is_set()
    assert middle.state["collector"]["env"]["parked"]
    second = Run(tmp_path, config, middle.steps)
    last = Checkpoint.load(train(second, homes, slow, Interruption(), middle))
    second.close()
    metrics = read_metrics(tmp_path)
    asked = [json.loads(line) for line in (tmp_path / "thoughts.jsonl").read_text().splitlines()]
    env = last.state["collector"]["env"]
    assert len(asked) == metrics[-1]["thoughts/answered"] == env["counts"]["answered"] == env["counts"]["asked"]
    assert metrics[-1]["thoughts/asked"] - metrics[-1]["thoughts/answered"] == len(env["parked"])
    assert 256 <= last.steps == metrics[-1]["steps"] < 256 + 5 * config.num_envs
    # What the episodes that run now have taken, and those that ended, is all that was stepped.
    ended = sum(end["measures"]["steps"] for end in last.state["collector"]["recent"])
    assert last.state["collector"]["episodes_ended"] < 100
    assert ended + env["env"]["agents"]["steps"].sum() == last.steps


def test_the_best_checkpoint_on_validation_is_kept(tmp_path: Path, smoke: TrainConfig) -> None:
    config = config_of(smoke, "scenes.validation=0.2", "checkpoint_every=64", "keep_checkpoints=1")
    homes = make_homes(config)
    names = [{episode.episode_id for episode in split} for split in (homes.train, homes.held_out, homes.validation)]
    assert all(names)
    assert sum(map(len, names)) == len(set.union(*names)) == 30
    run = Run.create(tmp_path, config)
    train(run, homes, planner(), Interruption())
    run.close()
    rows = read_log(tmp_path / "validation.jsonl")
    assert [row["steps"] for row in rows] == [64, 128, 192, 256]
    best = Checkpoint.load(tmp_path / "checkpoints" / BEST)
    assert best.steps == max(rows, key=lambda row: (row["spl"], -row["steps"]))["steps"]
    assert best.state["best"] == max(row["spl"] for row in rows)
    assert [path.stem for path in list_checkpoints(tmp_path)] == ["0000000000", "0000000256"]


def test_an_interrupted_run_saves_and_ends(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    run = Run.create(tmp_path, config_of(smoke))
    interruption = Interruption()

    def interrupting(request: object) -> str:
        interruption.request(2)
        return "turn left"

    last = train(run, homes, PlannerClient(MockTransport(interrupting)), interruption)
    run.close()
    assert Checkpoint.load(last).steps == 64
    assert interruption.exit_code == 130


def test_a_warm_start_that_is_interrupted_begins_anew(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = config_of(smoke, "warm_start.steps=192")
    whole = Run.create(tmp_path / "whole", config)
    train(whole, homes, planner(), Interruption())
    whole.close()
    interruption = Interruption()
    asked = 0

    def interrupting(request: SubgoalRequest) -> str:
        nonlocal asked
        asked += 1
        if asked == 12:
            interruption.request(2)
        return ("turn left", "move forward")[int(request.request_id) % 2]

    first = Run.create(tmp_path / "halves", config)
    middle = train(first, homes, PlannerClient(MockTransport(interrupting)), interruption)
    first.close()
    assert 0 < read_metrics(tmp_path / "halves")[-1]["steps"] < 192
    second = Run(tmp_path / "halves", config, steps=Checkpoint.load(middle).steps)
    train(second, homes, planner(), Interruption(), resume_from=Checkpoint.load(middle))
    second.close()
    a, b = (Checkpoint.load(list_checkpoints(tmp_path / name)[-1]) for name in ("whole", "halves"))
    for name, weight in a.policy.items():
        assert torch.equal(weight, b.policy[name]), name
    for log in ("metrics", "thoughts", "embeddings"):
        texts = {(tmp_path / name / f"{log}.jsonl").read_text() for name in ("whole", "halves")}
        assert len(texts) == 1, log


def test_a_checkpoint_for_other_actions_is_not_resumed(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    run = Run.create(tmp_path, config_of(smoke, "total_steps=64"))
    last = Checkpoint.load(train(run, homes, planner(), Interruption()))
    run.close()
    other = Run(tmp_path, config_of(smoke, "think.strategy=never"), steps=64)
    with pytest.raises(CheckpointError, match=r"turn_right, think\], here they are \[stop, .*turn_right\]"):
        train(other, homes, None, Interruption(), resume_from=last)
    other.close()


def test_a_run_ends_when_its_planner_is_gone(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = config_of(smoke, "think.patience=0")
    run = Run.create(tmp_path, config)
    with pytest.raises(Unavailable, match="has not answered"):
        train(run, homes, PlannerClient(MockTransport(lambda request: Unavailable("gone"))), Interruption())
    run.close()


def test_evaluation_plays_every_episode_once(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = config_of(smoke)
    with planner() as asked:
        policy = Policy(observation_shape(config, asked), config.policy)
        records = evaluate(policy, config, homes.scenes, homes.train[:7], asked, Interruption())
        again = evaluate(policy, config, homes.scenes, homes.train[:7], asked, Interruption())
    assert [record.episode_id for record in records] == [episode.episode_id for episode in homes.train[:7]]
    for record in records:
        assert len(record.path) == record.measures["steps"]
        assert len(record.thoughts) == record.measures["thinks"]
        assert all(step < len(record.path) for step, _ in record.thoughts)
    assert [record.path for record in again] == [record.path for record in records]
    write_evaluation(tmp_path, {"split": "train"}, records)
    result, read = read_evaluation(tmp_path)
    assert [record.measures for record in read] == [record.measures for record in records]
    assert result["summary"] == summarize(records)
    assert result["summary"]["steps"]["mean"] == pytest.approx(sum(len(r.path) for r in records) / 7)


def test_only_the_env_that_an_episode_was_dealt_to_counts() -> None:
    ends = [EpisodeEnd(env, episode, {}, {}) for env in range(3) for episode in range(7)]
    dealt = [(end.env, end.episode_index) for end in ends if is_of_own_share(end, 3)]
    assert dealt == [(0, 0), (0, 3), (0, 6), (1, 1), (1, 4), (2, 2), (2, 5)]
