"""A number that is not finite stops the run, is named, and can be seen again from the dump."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.checkpoint import CheckpointError
from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.dumps import TrainingDiverged
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.ppo import PPO
from thinknav_trainer.redo import redo_dump
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import train


def diverged(folder: Path, smoke: TrainConfig, homes: Homes) -> tuple[str, Path]:
    """What the run says, and the dump that it names."""
    run = Run.create(folder, change_config(smoke, overrides=["think.strategy=never", "ppo.precision=float32"]))
    with pytest.raises(TrainingDiverged) as caught:
        train(run, homes, None, Interruption())
    run.close()
    found = re.search(r"thinknav redo (.*)$", str(caught.value))
    assert found
    return str(caught.value), Path(found.group(1))


def _breaking(stepped: Any) -> Any:
    def broken(self: ObjectNavVectorEnv, envs: Any, actions: Any) -> Any:
        result = stepped(self, envs, actions)
        if self._states.steps[2] == 5:
            result[0]["depth"][2, 3, 4] = np.nan
        return result

    return broken


def test_an_observation(tmp_path: Path, smoke: TrainConfig, homes: Homes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ObjectNavVectorEnv, "step_subset", _breaking(ObjectNavVectorEnv.step_subset))
    said, dump = diverged(tmp_path, smoke, homes)
    assert "not finite after 0 steps: depth of envs [2]" in said
    assert "depth of env 2: 1 of 1024 numbers, at pose [" in redo_dump(dump)


@pytest.mark.parametrize(
    ("override", "what"), [("warm_start.lr=1e30", "in the warm start"), ("seed=0", "depth of envs")]
)
def test_in_a_warm_start(
    tmp_path: Path, smoke: TrainConfig, homes: Homes, monkeypatch: pytest.MonkeyPatch, override: str, what: str
) -> None:
    if override == "seed=0":
        monkeypatch.setattr(ObjectNavVectorEnv, "step_subset", _breaking(ObjectNavVectorEnv.step_subset))
    overrides = ["think.strategy=never", "warm_start.demonstrator=bump-walker", "warm_start.steps=128", override]
    run = Run.create(tmp_path, change_config(smoke, overrides=[*overrides, "ppo.precision=float32"]))
    with pytest.raises(TrainingDiverged, match=what) as caught:
        train(run, homes, None, Interruption())
    run.close()
    found = re.search(r"thinknav redo (.*)$", str(caught.value))
    assert found
    assert "the run stopped at" in redo_dump(Path(found.group(1)))


def test_a_loss(tmp_path: Path, smoke: TrainConfig, homes: Homes, monkeypatch: pytest.MonkeyPatch) -> None:
    value_loss = PPO._value_loss

    def broken(self: PPO, values: Any, old: Any, returns: Any) -> Any:
        return value_loss(self, values, old, returns * float("inf"))

    monkeypatch.setattr(PPO, "_value_loss", broken)
    said, dump = diverged(tmp_path, smoke, homes)
    assert "value_loss of an update" in said
    assert "once more: value_loss of an update" in redo_dump(dump)
    monkeypatch.undo()
    assert "the same minibatch is finite here" in redo_dump(dump)


def test_a_loss_of_the_last_rollout_learnt_beside_collecting(
    tmp_path: Path, smoke: TrainConfig, homes: Homes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That is learnt when nothing is collected any more."""
    value_loss = PPO._value_loss

    def broken(self: PPO, values: Any, old: Any, returns: Any) -> Any:
        return value_loss(self, values, old, returns * float("inf"))

    monkeypatch.setattr(PPO, "_value_loss", broken)
    beside = ("deterministic=false", "learn_beside=true", f"total_steps={smoke.steps_per_update}")
    said, dump = diverged(tmp_path, change_config(smoke, overrides=beside), homes)
    assert "value_loss of an update" in said
    assert "once more: value_loss of an update" in redo_dump(dump)


def test_a_gradient(tmp_path: Path, smoke: TrainConfig, homes: Homes, monkeypatch: pytest.MonkeyPatch) -> None:
    policy_loss = PPO._policy_loss

    def broken(self: PPO, ratio: torch.Tensor, advantages: torch.Tensor) -> torch.Tensor:
        # Finite, with a derivative that is not: the root of zero.
        zero = (self.policy.actor.bias - self.policy.actor.bias.detach()).sum()
        return policy_loss(self, ratio, advantages) + zero.abs().sqrt()

    monkeypatch.setattr(PPO, "_policy_loss", broken)
    said, dump = diverged(tmp_path, smoke, homes)
    assert "gradients of actor.bias" in said
    assert "once more: gradients of actor.bias" in redo_dump(dump)


def test_a_file_that_is_no_dump_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.pt").write_text("hello")
    torch.save({"policy": {}}, tmp_path / "other.pt")
    for name, words in (("x.pt", "is no checkpoint"), ("absent.pt", "no checkpoint"), ("other.pt", "is no dump")):
        with pytest.raises(CheckpointError, match=words) as refused:
            redo_dump(tmp_path / name)
        assert name in str(refused.value)
