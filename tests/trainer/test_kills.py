"""Killed at any moment and resumed, a run ends as if nothing had happened.

THINKNAV_KILLS sets how often it is killed; the default is kept small. For fifty times:
THINKNAV_KILLS=50 pytest tests/trainer/test_kills.py
"""

import json
import multiprocessing
import os
import random
import time
from collections.abc import Callable
from multiprocessing.context import ForkServerContext
from pathlib import Path

import pytest
import torch

from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.run import Run, list_checkpoints, newest_checkpoint, read_metrics
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.train import train

KILLS = int(os.environ.get("THINKNAV_KILLS", "4"))
OVERRIDES = (
    *("policy.stop_bias=-1", "policy.think_bias=1", "ppo.precision=float32", "checkpoint_every=64"),
    *("think.budget=0.2", "think.dropout=0.3", "think.forced=0.2"),
)


def go_on(folder: Path, config: TrainConfig, latency: float) -> None:
    """Begin or resume, to the end."""
    torch.set_num_threads(1)
    planner = PlannerClient(MockTransport(lambda request: ("turn left", "go on")[len(request.goal) % 2], latency))
    if (folder / "config.yaml").exists():
        start = newest_checkpoint(folder) if list_checkpoints(folder) else None
        run = Run(folder, config, 0 if start is None else start.steps)
    else:
        start, run = None, Run.create(folder, config)
    train(run, make_homes(config), planner, Interruption(), start)
    run.close()


@pytest.fixture(scope="module")
def context() -> ForkServerContext:
    """Processes that have imported everything already."""
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload([__name__])
    return made


def run_to_the_end(context: ForkServerContext, kills: int, seconds: float, *arguments: object) -> float:
    """Start it until it has ended by itself, killed at a random moment the first `kills` times: its last duration."""
    moments = random.Random(1)
    for attempt in range(kills + 1):
        process = context.Process(target=go_on, args=arguments)
        start = time.monotonic()
        process.start()
        process.join(moments.uniform(0, seconds) if attempt < kills else None)
        if process.is_alive():
            process.kill()
            process.join()
        elif attempt == kills or process.exitcode != 0:
            break
    assert process.exitcode == 0
    return time.monotonic() - start


@pytest.fixture
def kill(context: ForkServerContext, tmp_path: Path) -> Callable[[TrainConfig, float], tuple[Path, Path]]:
    """Runs a configuration undisturbed and killed: the two folders."""

    def run(config: TrainConfig, latency: float) -> tuple[Path, Path]:
        seconds = run_to_the_end(context, 0, 0.0, tmp_path / "whole", config, latency)
        run_to_the_end(context, KILLS, seconds, tmp_path / "killed", config, latency)
        return tmp_path / "whole", tmp_path / "killed"

    return run


def test_in_lock_step_it_is_the_same_run(
    kill: Callable[[TrainConfig, float], tuple[Path, Path]], smoke: TrainConfig
) -> None:
    whole, killed = kill(change_config(smoke, overrides=OVERRIDES), 0.0)
    a, b = (Checkpoint.load(list_checkpoints(folder)[-1]) for folder in (whole, killed))
    assert a.steps == b.steps == 256
    for name, weight in a.policy.items():
        assert torch.equal(weight, b.policy[name]), name
    for log in ("metrics", "thoughts", "embeddings"):
        assert (whole / f"{log}.jsonl").read_text() == (killed / f"{log}.jsonl").read_text(), log


@pytest.mark.parametrize("beside", ["learn_beside=false", "learn_beside=true"])
def test_without_waiting_nothing_is_lost_and_nothing_counts_twice(
    kill: Callable[[TrainConfig, float], tuple[Path, Path]], smoke: TrainConfig, beside: str
) -> None:
    _, killed = kill(change_config(smoke, overrides=["deterministic=false", beside, *OVERRIDES]), 0.01)
    last = Checkpoint.load(list_checkpoints(killed)[-1])
    metrics = read_metrics(killed)
    steps = [row["steps"] for row in metrics]
    assert steps == sorted(set(steps))
    assert steps[-1] == last.steps >= 256
    env = last.state["collector"]["env"]
    ended = sum(end["measures"]["steps"] for end in last.state["collector"]["recent"])
    assert last.state["collector"]["episodes_ended"] == len(last.state["collector"]["recent"])
    assert ended + env["env"]["agents"]["steps"].sum() == last.steps
    thoughts = [json.loads(line) for line in (killed / "thoughts.jsonl").read_text().splitlines()]
    assert len(thoughts) == env["counts"]["answered"] == metrics[-1]["thoughts/answered"]
    assert [row["round"] for row in thoughts] == sorted(row["round"] for row in thoughts)
    assert len({(row["round"], row["env"]) for row in thoughts}) == len(thoughts)
