"""Going on with a run: what may be changed and counts, what may not and is refused, and what was damaged meanwhile."""

from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.cli import app
from thinknav_trainer.config import ConfigError, TrainConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.run import Run, list_checkpoints, read_log, read_metrics
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import train
from thinknav_trainer.workflow import train_run


def begun(folder: Path, config: TrainConfig, homes: Homes) -> None:
    planner = None if config.think.strategy == "never" else PlannerClient(MockTransport(lambda request: "turn left"))
    with closing(Run.create(folder, config)) as run:
        train(run, homes, planner, Interruption())


def unthinking(smoke: TrainConfig, *overrides: str) -> TrainConfig:
    return change_config(smoke, overrides=["think.strategy=never", "total_steps=64", *overrides])


@pytest.mark.parametrize(
    ("first", "then", "words"),
    [
        (["think.forced=0.3"], ["think.forced=0"], "think.forced from nothing or to nothing"),
        ([], ["think.forced=0.3"], "think.forced from nothing or to nothing"),
        ([], ["think.strategy=every_n"], "think.strategy"),
        (["warm_start.steps=64"], ["ppo.kl_coef=0.1"], "ppo.kl_coef from nothing"),
        (["warm_start.steps=64"], ["warm_start.steps=512"], "warm_start.steps"),
        ([], ["seed=9"], "seed"),
    ],
)
def test_what_a_checkpoint_does_not_fit_is_refused_and_nothing_is_written(
    tmp_path: Path, smoke: TrainConfig, homes: Homes, first: list[str], then: list[str], words: str
) -> None:
    config = change_config(smoke, overrides=["total_steps=128", "planner.url=privileged", *first])
    begun(tmp_path, config, homes)
    before = (tmp_path / "config.yaml").read_text()
    other = change_config(config, overrides=["total_steps=256", *then])
    with pytest.raises(ConfigError, match=f"a run that goes on cannot change {words}; start another"):
        train_run(tmp_path, other, Interruption(), resume=True, homes=homes)
    assert (tmp_path / "config.yaml").read_text() == before


def test_a_run_that_is_done_stays_as_it_is(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = unthinking(smoke)
    begun(tmp_path, config, homes)
    files = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    last = train_run(tmp_path, change_config(config, overrides=["ppo.lr=0.5"]), Interruption(), resume=True)
    assert last == list_checkpoints(tmp_path)[-1]
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == files


def test_a_learning_rate_that_was_changed_counts(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = unthinking(smoke)
    begun(tmp_path, config, homes)
    other = change_config(config, overrides=["total_steps=128", "ppo.lr=0.01", "ppo.adam_eps=0.1"])
    last = Checkpoint.load(train_run(tmp_path, other, Interruption(), resume=True, homes=homes))
    (group,) = last.state["learner"]["optimizer"]["param_groups"]
    assert (group["lr"], group["eps"]) == (0.01, 0.1)


def test_a_damaged_newest_checkpoint_is_set_aside(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = unthinking(smoke, "total_steps=192", "checkpoint_every=64", "keep_checkpoints=2")
    begun(tmp_path, config, homes)
    newest = list_checkpoints(tmp_path)[-1]
    newest.write_bytes(newest.read_bytes()[:1000])
    kept_one = change_config(config, overrides=["keep_checkpoints=1"])
    last = train_run(tmp_path, kept_one, Interruption(), resume=True, homes=homes)
    assert Checkpoint.load(last).steps == 192
    assert [path.stem for path in list_checkpoints(tmp_path)] == ["0000000000", "0000000192"]
    assert (tmp_path / "checkpoints" / f"{newest.name}.damaged").stat().st_size == 1000
    assert [row["steps"] for row in read_metrics(tmp_path)] == [64, 128, 192]


def test_the_taught_policy_and_the_last_one_are_validated(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = change_config(
        smoke, overrides=["warm_start.steps=64", "total_steps=192", "checkpoint_every=1000", "planner.url=privileged"]
    )
    split = Homes(homes.scenes, homes.train[:-3], homes.held_out, homes.train[-3:])
    begun(tmp_path, config, split)
    assert [row["steps"] for row in read_log(tmp_path / "validation.jsonl")] == [64, 192]


def test_a_preset_is_refused_where_the_run_has_its_own_configuration(tmp_path: Path) -> None:
    for option in (["--resume"], ["--replay", "other"]):
        done = CliRunner().invoke(app, ["train", "--name", "a", "--runs", str(tmp_path), "--preset", "cpu", *option])
        assert isinstance(done.exception, ConfigError)
        assert "--preset: the run that is gone on with or repeated has its own" in str(done.exception)
