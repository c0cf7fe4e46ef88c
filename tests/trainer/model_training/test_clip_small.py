"""The small image encoder's training: the same views in two sizes, and a pupil that comes nearer to its teacher."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from thinknav_models.clip.image import ClipImageEncoder
from thinknav_models.weights import WeightsError
from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training import clip_small
from thinknav_trainer.model_training.clip_small import SmallTower, SmallTraining, train_small
from thinknav_trainer.model_training.clip_small_workflow import train_and_describe
from thinknav_trainer.model_training.frames import FrameMaker, FramePlan

TRAINING = SmallTraining(4, warmup=1, checkpoint_every=2, log_every=1)


class OneRoom:
    """Homes of one room, which take little time to make."""

    def scene(self, index: int) -> Scene:
        return generate_home(home_seed("planner", index), rooms=1)


PLAN = FramePlan(OneRoom(), ObjectNavConfig(), 0, scenes_per_batch=2, frames_per_scene=3, mirror=False)


@pytest.fixture(scope="module")
def views() -> tuple[Tensor, Tensor]:
    large, small = FrameMaker(PLAN).sizes(0, (128, 64))
    return torch.from_numpy(large), torch.from_numpy(small)


def test_both_sizes_show_the_same_views(views: tuple[Tensor, Tensor]) -> None:
    large, small = views
    assert large.shape == (6, 128, 128, 3)
    assert small.shape == (6, 64, 64, 3)
    halved = functional.avg_pool2d(large.permute(0, 3, 1, 2).float(), 2).permute(0, 2, 3, 1)
    difference = (halved - small.float()).abs()
    assert difference.mean() < 8
    assert (halved - small.roll(1, 0).float()).abs().mean() > 2 * difference.mean()
    again = FrameMaker(PLAN).batch(0).rgb
    np.testing.assert_array_equal(again, large.numpy())


def test_the_pupil_comes_nearer_and_ships_what_it_has_learnt(
    views: tuple[Tensor, Tensor], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clip_small, "views", lambda plan, start: iter([views] * 100))
    tower = train_small(PLAN, replace(TRAINING, batches=40), tmp_path, Interruption())
    errors = [json.loads(line)["error"] for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert errors[-1] < 0.5 * errors[0]
    revision = tower.save(tmp_path / "small.safetensors")
    encoder = ClipImageEncoder.load_small(tmp_path / "small.safetensors", dtype=torch.float32)
    assert encoder.revision == revision
    with torch.no_grad():
        own = tower(views[1]).flatten(1)
    torch.testing.assert_close(encoder.features(views[1]).float(), own.float(), atol=0.1, rtol=0.05)


def test_it_goes_on_where_it_stopped(
    views: tuple[Tensor, Tensor], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clip_small, "views", lambda plan, start: iter([views] * 10))
    whole = train_small(PLAN, TRAINING, tmp_path / "whole", Interruption())
    stopped = Interruption()
    made = iter([views, views])

    def stopping(plan: FramePlan, start: int) -> object:
        yield next(made)
        stopped.requested = True
        yield next(made)

    monkeypatch.setattr(clip_small, "views", stopping)
    train_small(PLAN, TRAINING, tmp_path / "stopped", stopped)
    monkeypatch.setattr(clip_small, "views", lambda plan, start: iter([views] * (4 - start)))
    resumed = train_small(PLAN, TRAINING, tmp_path / "stopped", Interruption())
    assert isinstance(resumed, SmallTower)
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name
    with pytest.raises(WeightsError, match="is of a training with other settings"):
        train_small(replace(PLAN, seed=1), TRAINING, tmp_path / "whole", Interruption())


def test_the_workflow_writes_weights_and_a_card(tmp_path: Path) -> None:
    """With a worker process, as people run it."""
    path = train_and_describe(
        tmp_path, tmp_path / "checkpoints", SmallTraining(1), "the command", Interruption(), evaluation_homes=2
    )
    assert path == tmp_path / "clip_small.safetensors"
    card = (tmp_path / "clip_small.md").read_text()
    assert ClipImageEncoder.load_small(path).revision in card
    assert "| frame to sentence, R@1 |" in card
    assert "128 frames of 8 procedural homes" in card
