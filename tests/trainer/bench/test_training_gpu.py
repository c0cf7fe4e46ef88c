"""What `thinknav bench train-gpu` measures, on the processor and small."""

import pytest
from typer.testing import CliRunner

from thinknav_trainer.bench.training_gpu import gpu_figures
from thinknav_trainer.cli import app
from thinknav_trainer.config import ConfigError

SMALL = (
    # Of smaller ones a ResNet strides over a single pixel, whose bfloat16 gradient is not finite on some processors.
    *("device=cpu", "env.width=64", "env.height=64", "scenes.homes=1", "scenes.rooms=1", "scenes.episodes=30"),
    *("policy.hidden_size=8", "policy.lstm_layers=1", "ppo.num_steps=4", "ppo.chunk_length=4", "ppo.epochs=1"),
)


def test_a_figure_for_each_number_of_envs_and_the_paper() -> None:
    figures = list(gpu_figures(1, (2, 4), SMALL))
    names = ["train.gpu.envs_2.steps_per_s", "train.gpu.envs_4.steps_per_s", "train.gpu.paper.steps_per_s"]
    assert [figure.figure for figure in figures] == names
    assert all(figure.value > 0 for figure in figures)


def test_without_a_gpu_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.device_count", lambda: 0)
    small = [part for override in SMALL[1:] for part in ("--set", override)]
    with pytest.raises(ConfigError, match="sees 0 CUDA GPUs here"):
        CliRunner().invoke(app, ["bench", "train-gpu", *small], catch_exceptions=False)
