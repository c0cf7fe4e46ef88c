"""The ResNet50 of the paper's baseline: Habitat's architecture, and the preset that sees through it."""

from pathlib import Path

import pytest
import torch

from thinknav_trainer import rollout
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import ConfigError, PolicyConfig, load_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.run import Run, read_metrics
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.train import train
from thinknav_trainer.vision import make_vision
from thinknav_trainer.vision_resnet import ResNetVision

CONFIG = PolicyConfig(image_encoder="resnet50", visual_size=8)


def vision(height: int, width: int) -> ResNetVision:
    torch.manual_seed(0)
    made = make_vision(height, width, CONFIG)
    assert isinstance(made, ResNetVision)
    return made


def pictures(count: int, height: int, width: int) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    return {
        "rgb": torch.randint(0, 256, (count, height, width, 3), dtype=torch.uint8, generator=generator),
        "depth": torch.rand(count, height, width, 1, generator=generator),
    }


def test_it_has_as_many_weights_as_habitats() -> None:
    """Those of Habitat-Baselines' resnet50(4, 32, 16), whose result with the same weights was the same to the bit."""
    made = vision(256, 256)
    assert sum(weight.numel() for weight in made.resnet.parameters()) == 5_894_208
    assert made.linear[0].weight.shape == (8, 2048)  # 128 channels of 4 x 4 cells


@pytest.mark.parametrize(("height", "width"), [(32, 32), (48, 70), (65, 129)])
def test_pictures_of_any_size(height: int, width: int) -> None:
    made = vision(height, width)
    seen = made(made.prepare(made.look(pictures(2, height, width))))
    assert seen.shape == (2, 8)
    assert torch.isfinite(seen).all()


def test_rgb_and_depth_both_matter_and_other_pictures_do_not() -> None:
    made, seen = vision(64, 64), pictures(2, 64, 64)
    both = made(made.prepare(seen))
    alone = made(made.prepare({name: values[:1] for name, values in seen.items()}))
    torch.testing.assert_close(both[:1], alone)
    for other in (seen | {"rgb": 255 - seen["rgb"]}, seen | {"depth": 1 - seen["depth"]}):
        assert not torch.allclose(both, made(made.prepare(other)))


def test_frames_too_small_for_it_are_refused() -> None:
    encoder = "policy.image_encoder=resnet50"
    with pytest.raises(ConfigError, match=r"needs 64 pixels each way, not 128 x 63; raise env\.height"):
        load_config("cpu", None, [encoder, "env.height=128", "env.width=63"])
    assert load_config("cpu", None, [encoder, "env.height=64", "env.width=64"]).policy.image_encoder == "resnet50"


def test_all_of_it_learns() -> None:
    made = vision(64, 64)
    made(made.prepare(pictures(2, 64, 64))).sum().backward()
    assert all(weight.grad is not None and weight.grad.any() for weight in made.resnet.parameters())


def test_the_paper_preset_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rollout, "TRANSITIONS_STEP", 8)  # an update of 64 takes its time
    small = ["num_envs=2", "total_steps=8", "ppo.num_steps=4", "ppo.chunk_length=4", "ppo.epochs=1"]
    home = ["scenes.rooms=1", "scenes.episodes=30", "ppo.minibatches=1"]
    config = load_config("paper", None, [*small, *home])
    assert (config.env.width, config.policy.hidden_size, config.policy.lstm_layers) == (256, 512, 2)
    run = Run.create(tmp_path, config)
    planner = PlannerClient(MockTransport(lambda request: "turn left"))
    last = Checkpoint.load(train(run, make_homes(config), planner, Interruption()))
    run.close()
    assert last.steps >= 8
    assert all(torch.isfinite(weight).all() for weight in last.policy.values())
    assert read_metrics(tmp_path)[-1]["losses/gradient_norm"] > 0
