"""Acting and learning elsewhere than on the processor: everything is brought along, and the numbers are the same."""

from pathlib import Path

import pytest
import torch

from tests.trainer.pretended_gpu import GPU, PretendedGPU
from thinknav_sim.render import WarpRenderer
from thinknav_trainer import train as story
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import ConfigError, TrainConfig, change_config, load_config
from thinknav_trainer.device import find_device, find_device_or_cpu
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import open_session, train


def trained(folder: Path, config: TrainConfig, homes: Homes) -> Checkpoint:
    run = Run.create(folder, config)
    planner = PlannerClient(MockTransport(lambda request: "turn left"))
    last = train(run, homes, planner, Interruption())
    run.close()
    return Checkpoint.load(last)


@pytest.mark.parametrize("image_encoder", ["learnt", "clip"])
def test_a_run_on_a_gpu_brings_everything_there(
    tmp_path: Path, smoke: TrainConfig, homes: Homes, monkeypatch: pytest.MonkeyPatch, image_encoder: str
) -> None:
    short = ["ppo.precision=float32", f"policy.image_encoder={image_encoder}", "warm_start.steps=64", "total_steps=192"]
    short += ["warm_start.foresight_coef=1", "think.forced=0.2", "policy.stop_bias=-1", "env.max_steps=20"]
    config = change_config(smoke, overrides=short)
    here = trained(tmp_path / "here", config, homes)
    monkeypatch.setattr(story, "find_device", lambda name: GPU)
    gpu = PretendedGPU()
    with gpu:
        there = trained(tmp_path / "there", config, homes)
    assert gpu.moved > 1000
    for name, weight in here.policy.items():
        if isinstance(weight, torch.Tensor):
            assert torch.equal(weight, there.policy[name]), name
    assert (tmp_path / "here/metrics.jsonl").read_text() == (tmp_path / "there/metrics.jsonl").read_text()


def test_the_pretended_gpu_notices_what_was_left_behind() -> None:
    with PretendedGPU(), pytest.raises(AssertionError, match="partly on the GPU"):
        torch.ones(2).to(GPU) + torch.ones(2)
    with PretendedGPU(), pytest.raises(AssertionError, match="indexed by one on the GPU"):
        torch.ones(2)[torch.zeros(1, dtype=torch.int64).to(GPU)]


def test_a_gpu_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert find_device("cpu") == torch.device("cpu")
    assert find_device("cuda") == torch.device("cuda", 0)
    assert find_device("cuda:1") == find_device_or_cpu("cuda:1") == torch.device("cuda", 1)
    monkeypatch.setenv("LOCAL_RANK", "1")
    assert find_device("cuda") == torch.device("cuda", 1)
    with pytest.raises(ConfigError, match=r"device cuda:2: .* sees 2 CUDA GPUs here, and GPU 2 is wanted"):
        find_device("cuda:2")
    assert find_device_or_cpu("cuda:2") == torch.device("cpu")
    with pytest.raises(ConfigError, match="device: "):
        load_config("smoke", None, ["device=gpu"])


def test_a_run_may_be_drawn_by_another_renderer(smoke: TrainConfig, homes: Homes) -> None:
    never = ["think.strategy=never", "ppo.precision=float32", "policy.think_bias=0"]
    for name in ("auto", "warp"):
        session = open_session(change_config(smoke, overrides=[*never, f"renderer={name}"]), homes, None)
        assert isinstance(session.env.env.world.renderer, WarpRenderer) == (name == "warp")
        assert len(session.collector.collect()) == 64
        session.env.env.close()
