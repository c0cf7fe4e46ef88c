"""Several workers, one run: in real processes over gloo."""

import json
import os
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from tests.trainer.worker_processes import together, values
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer import workflow
from thinknav_trainer.actor import Actor
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import ConfigError, TrainConfig, change_config
from thinknav_trainer.dumps import read_dump
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.policy import Policy
from thinknav_trainer.run import list_checkpoints, read_metrics
from thinknav_trainer.run_elsewhere import RunElsewhere
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.train import agree, observation_shape
from thinknav_trainer.vision import EmbeddingSpaceError
from thinknav_trainer.workers import Lone, Workers, join_workers, seed_of

OVERRIDES = (
    *("ppo.precision=float32", "policy.stop_bias=-1", "policy.think_bias=1"),
    *("think.budget=0.2", "think.dropout=0.3"),
)


@pytest.fixture(scope="module")
def config(smoke: TrainConfig) -> TrainConfig:
    return change_config(smoke, overrides=OVERRIDES)


# One worker is in trouble


def be_killed(workers: Workers) -> None:
    workers.gather(workers.rank)
    if workers.rank == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    workers.gather(workers.rank)


def fail(workers: Workers) -> None:
    if workers.rank == 1:
        raise ValueError("something of its own")
    workers.gather(workers.rank)


def be_late(workers: Workers) -> None:
    workers.gather(workers.rank)
    if workers.rank == 1:
        time.sleep(8)
    workers.gather(workers.rank)


def test_a_killed_worker_is_named(config: TrainConfig) -> None:
    first, second = together(be_killed, config)
    assert first.error == "WorkerLost: worker 1 is gone: killed, or cut off"
    assert second.exit_code == -signal.SIGKILL


def test_of_a_worker_that_fails_the_others_say_nothing(config: TrainConfig) -> None:
    first, second = together(fail, config)
    assert second.error == "ValueError: something of its own"
    assert first.error == "SystemExit: 1"


def test_a_late_worker_is_named(config: TrainConfig) -> None:
    first, _ = together(be_late, change_config(config, overrides=["workers.timeout=2"]))
    assert first.error == "WorkerLost: worker 1 is late: waited for 2 s (workers.timeout)"


def test_workers_do_not_wait_for_ever_to_come_together(config: TrainConfig) -> None:
    [first] = together(be_late, change_config(config, overrides=["workers.timeout=1"]), count=1, missing=1)
    assert first.error is not None
    assert first.error.startswith("WorkerLost: the workers have not come together: ")


# Stragglers


def collect_twice(workers: Workers, config: TrainConfig) -> list[int]:
    """Sizes of two rollouts: in each another worker makes its first step when the other one has finished."""
    homes = make_homes(config)
    vector_env = ObjectNavVectorEnv(homes.scenes, homes.train, config.num_envs, config.task, seed=workers.rank)
    env = ThinkingEnv(vector_env, config.think, None)
    actor = Actor(Policy(observation_shape(config, None), config.policy), config.num_envs, "float32", workers.rank)
    collector = Collector(env, actor, config.ppo, workers)
    sizes = []
    for slow in (1, 0):
        deadline = time.monotonic() + 60
        while workers.rank == slow and not workers.most_are_done():
            assert time.monotonic() < deadline
            time.sleep(0.01)
        sizes.append(len(collector.collect()))
        workers.gather(None)
    return sizes


def test_a_straggler_stops_after_a_quarter(config: TrainConfig) -> None:
    alone = ["think.strategy=never", "think.budget=null", "think.dropout=0"]
    never = change_config(config, overrides=[*alone, "deterministic=false", "workers.sync_frac=0.5"])
    assert values(together(collect_twice, never, never)) == [[64, 16], [16, 64]]


def say_done(workers: Workers) -> bool:
    workers.done()
    workers.gather(None)
    return workers.most_are_done()


def test_in_lock_step_nobody_stops_early(config: TrainConfig) -> None:
    assert config.deterministic
    assert values(together(say_done, config)) == [False, False]


# One run


def go_on(workers: Workers, folder: Path, config: TrainConfig, homes: Homes, resume: bool, stop: bool = False) -> Path:
    planner = PlannerClient(MockTransport(lambda request: ("turn left", "go on")[len(request.goal) % 2]))
    interruption = Interruption()
    if stop:
        interruption.request(signal.SIGTERM)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workflow, "connect_if_thinking", lambda config, stack: planner)
        return workflow.train_run(folder, config, interruption, resume, homes, workers=workers)


def run_whole_and_in_halves(workers: Workers, folder: Path, config: TrainConfig) -> list[Path]:
    homes = make_homes(config)
    short = change_config(config, overrides=["total_steps=128"])
    return [
        go_on(workers, folder / "whole", config, homes, resume=False),
        go_on(workers, folder / "halves", short, homes, resume=False),
        go_on(workers, folder / "halves", config, homes, resume=True),
        go_on(workers, folder / "stopped", config, homes, resume=False, stop=workers.rank == 1),
    ]


def resume(workers: Workers, folder: Path, config: TrainConfig) -> Path:
    return go_on(workers, folder, config, make_homes(config), resume=True)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, config: TrainConfig) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    first, second = values(together(run_whole_and_in_halves, config, folder, config))
    assert first == second
    return folder


def last(folder: Path) -> Checkpoint:
    return Checkpoint.load(list_checkpoints(folder)[-1])


def thoughts(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "thoughts.jsonl").read_text().splitlines()]


def test_steps_are_counted_in_all_and_written_once(runs: Path, config: TrainConfig) -> None:
    assert [row["steps"] for row in read_metrics(runs / "whole")] == [128, 256]
    assert [path.stem for path in list_checkpoints(runs / "whole")] == ["0000000000", "0000000128", "0000000256"]
    state = last(runs / "whole").state
    [other] = state["others"]
    envs = [each["env"] for each in (state["collector"], other["collector"])]
    metrics = read_metrics(runs / "whole")[-1]
    assert metrics["thoughts/asked"] == sum(env["counts"]["asked"] for env in envs)
    assert len(thoughts(runs / "whole")) == envs[0]["counts"]["asked"] < metrics["thoughts/asked"]
    assert metrics["episodes"] == state["collector"]["episodes_ended"] + other["collector"]["episodes_ended"]
    ended = [end["measures"] for each in (state["collector"], other["collector"]) for end in each["recent"]]
    assert metrics["spl"] == pytest.approx(np.mean([measures["spl"] for measures in ended]))
    assert sum(m["steps"] for m in ended) + sum(env["env"]["agents"]["steps"].sum() for env in envs) == 256
    assert metrics["thoughts/withheld"] == sum(env["counts"]["withheld"] for env in envs) > 0
    assert metrics["think_price"] == state["price"]["now"] == pytest.approx(0.012)  # both rollouts were far above
    poses = [env["env"]["agents"]["poses"] for env in envs]
    assert not np.array_equal(*poses)


def test_a_resumed_run_of_as_many_workers_is_the_same(runs: Path) -> None:
    whole, halves = last(runs / "whole"), last(runs / "halves")
    for name, weight in whole.policy.items():
        assert torch.equal(weight, halves.policy[name]), name
    for log in ("metrics", "thoughts", "embeddings"):
        assert (runs / "whole" / f"{log}.jsonl").read_text() == (runs / "halves" / f"{log}.jsonl").read_text(), log


def test_what_interrupts_one_ends_it_for_all(runs: Path) -> None:
    assert last(runs / "stopped").steps == 0


def test_one_goes_on_where_two_stopped(runs: Path, config: TrainConfig, homes: Homes, tmp_path: Path) -> None:
    folder = shutil.copytree(runs / "whole", tmp_path / "run")
    before = read_metrics(folder)[-1]
    own = len(thoughts(folder))
    go_on(Lone(), folder, change_config(config, overrides=["total_steps=320"]), homes, resume=True)
    after = read_metrics(folder)[-1]
    assert after["steps"] == 320
    assert after["thoughts/asked"] - before["thoughts/asked"] == len(thoughts(folder)) - own > 0
    assert after["thoughts/asked"] == after["thoughts/answered"]
    assert after["episodes"] >= before["episodes"]
    assert last(folder).state["others"] == []
    optimizer = last(folder).state["learner"]["optimizer"]["state"][0]
    assert optimizer["step"] == last(runs / "whole").state["learner"]["optimizer"]["state"][0]["step"] + 8


def test_three_go_on_where_two_stopped(runs: Path, config: TrainConfig, tmp_path: Path) -> None:
    folder = shutil.copytree(runs / "whole", tmp_path / "run")
    longer = change_config(config, overrides=["total_steps=448"])
    values(together(resume, longer, folder, longer, count=3))
    assert [row["steps"] for row in read_metrics(folder)] == [128, 256, 448]
    others = last(folder).state["others"]
    known, new = (other["collector"]["env"]["env"]["agents"] for other in others)
    played = [collector["episodes_ended"] for collector in (other["collector"] for other in others)]
    assert (new["draws"] < known["draws"]).any()
    assert read_metrics(folder)[-1]["episodes"] == sum(played) + last(folder).state["collector"]["episodes_ended"]


def test_parked_envs_of_a_worker_that_is_no_more_have_asked_in_vain(smoke: TrainConfig, homes: Homes) -> None:
    def env() -> ThinkingEnv:
        vector_env = ObjectNavVectorEnv(homes.scenes, homes.train, 2, smoke.task, seed=0)
        made = ThinkingEnv(vector_env, smoke.think, PlannerClient(MockTransport(lambda request: "turn left")))
        made.reset()
        return made

    gone, left = env(), env()
    gone.step(np.array([Action.THINK, Action.MOVE_FORWARD]))
    gone.think(np.array([0, 1]))
    left.adopt_counts(gone.state_dict())
    assert vars(left.counts) == {"asked": 3, "answered": 1, "failed": 2, "withheld": 0}


def test_a_replay_is_for_one_process(config: TrainConfig, tmp_path: Path) -> None:
    class Two(Lone):
        count = 2

    with pytest.raises(ConfigError, match="run of one process"):
        workflow.train_run(tmp_path, config, Interruption(), replay=tmp_path, workers=Two())


def test_of_a_run_elsewhere_only_the_dump_is_written(config: TrainConfig, tmp_path: Path) -> None:
    run = RunElsewhere(tmp_path, config, rank=1)
    run.log(64, {"success": 1.0}, {})
    path = run.dump(64, {"what": "a test"})
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == [path]
    assert path.name == "0000000064-worker1.pt"
    assert read_dump(path) == {"what": "a test"}


def test_planners_of_several_embedding_spaces_are_refused(config: TrainConfig) -> None:
    class Two(Lone):
        count = 2

        def gather(self, value: Any) -> list[Any]:
            return [value, "another@0"]

    with pytest.raises(EmbeddingSpaceError, match="spaces: None, another@0"):
        agree(Two(), Policy(observation_shape(config, None), config.policy), None)


def test_seeds_are_apart() -> None:
    seeds = [seed_of(seed, rank, steps) for seed in range(4) for rank in range(4) for steps in (0, 128)]
    assert len(set(seeds)) == 4 * 3 * 2 + 4
    assert seed_of(7, 0, 128) == 7


def test_without_torchrun_a_worker_is_alone(config: TrainConfig) -> None:
    with join_workers(lambda: config) as (workers, found):
        assert isinstance(workers, Lone)
        assert found == config
