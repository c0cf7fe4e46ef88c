"""The trainer's figures on a GPU: steps per second of the presets made for one, by the number of envs."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

from thinknav_trainer.bench.figures import Figure, rounded
from thinknav_trainer.bench.training import NEVER, rates
from thinknav_trainer.config import TrainConfig, load_config
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.train import Session, open_session

ENVS = (64, 128, 256, 512, 1024, 2048)


def gpu_figures(repeats: int, envs: Iterable[int] = ENVS, overrides: Sequence[str] = ()) -> Iterator[Figure]:
    """Steps per second, without a planner, from frames drawn to updated weights: preset `gpu` with as many envs as
    `envs` says, one after the other, then preset `paper`.

    overrides: over both presets. Raises ConfigError without a GPU, and RendererUnavailable without Warp.
    """
    for count in envs:
        config = load_config("gpu", None, [*NEVER, *overrides, f"num_envs={count}"])
        yield _speed(f"train.gpu.envs_{count}", config, repeats)
    paper = load_config("paper", None, [*NEVER, "device=cuda", "renderer=warp", *overrides])
    yield _speed("train.gpu.paper", paper, repeats)


def _speed(name: str, config: TrainConfig, repeats: int) -> Figure:
    [rate] = rates(repeats, partial(_open, config))
    return Figure(f"{name}.steps_per_s", rounded(rate), "steps/s")


def _open(config: TrainConfig) -> Session:
    return open_session(config, make_homes(config), None)
