"""`thinknav train`: what its options make of the configuration."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from thinknav_trainer.cli import app
from thinknav_trainer.config import ConfigError, TrainConfig
from thinknav_trainer.run import read_config

SHORT = ("--preset", "smoke", "--set", "total_steps=64", "--planner", "privileged")


def trained(folder: Path, *options: str) -> TrainConfig:
    """The configuration of a run that was made with some options."""
    result = CliRunner().invoke(app, ["train", "--name", "a", "--runs", str(folder), *SHORT, *options])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return read_config(folder / "a")


def test_a_strategy_and_a_reward_by_name(tmp_path: Path) -> None:
    think = trained(tmp_path, "--strategy", "every_n", "--reward", "capped").think
    assert (think.strategy, think.reward) == ("every_n", "capped")


def test_one_of_them_leaves_the_other_alone(tmp_path: Path) -> None:
    think = trained(tmp_path, "--strategy", "never", "--set", "think.reward=paper").think
    assert (think.strategy, think.reward) == ("never", "paper")


@pytest.mark.parametrize(("option", "words"), [("--strategy", "think.strategy: .*'never'"), ("--reward", "'capped'")])
def test_a_wrong_name_is_refused(tmp_path: Path, option: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        trained(tmp_path, option, "often")
