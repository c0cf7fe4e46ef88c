"""`thinknav eval`: where results lie, how they are told, and options that would change nothing."""

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from thinknav_trainer.cli import app
from thinknav_trainer.config import ConfigError, TrainConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.records import MEASURES, EpisodeRecord, write_evaluation
from thinknav_trainer.report.page import write_report
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import train


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory, smoke: TrainConfig, homes: Homes) -> Path:
    """Of a policy that cannot think, the quickest to play."""
    run = Run.create(
        tmp_path_factory.mktemp("runs") / "[red]one",
        change_config(smoke, overrides=["think.strategy=never", "total_steps=64"]),
    )
    last = train(run, homes, None, Interruption())
    run.close()
    return last


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--preset", "cpu", "--set", "seed=1"], "--preset, --set: for --agent; a checkpoint's policy plays the task"),
        (["--config", "x.yaml"], "--config: for --agent"),
        (["--context", "5", "--turns", "2"], "--context, --turns: for --agent"),
        (["--episodes", "5"], "--episodes: a split of the run is played whole"),
        (["--homes", "val:0-1", "--split", "train"], "--split: a split of the run is not played where val:0-1 is"),
        (["--scenes", "scans"], "--scenes is the folder of a file's scenes: give --episodes-file too"),
        (["--output", __file__], "test_evaluate_command.py is not a folder"),
        (["--control", "zeros"], "a control replaces replies, and the policy of this checkpoint never thinks"),
        (["--think-bias", "nan"], "a bias of thinking is a finite number, not nan"),
        (["--split", "test"], "there is no split 'test'; there are held_out and train"),
    ],
)
def test_what_would_change_nothing_for_a_checkpoint_is_refused(
    checkpoint: Path, options: list[str], words: str
) -> None:
    done = CliRunner().invoke(app, ["eval", str(checkpoint), *options])
    assert isinstance(done.exception, ConfigError)
    assert words in str(done.exception)
    assert not list(checkpoint.parents[1].rglob("result.json"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["random", "--greedy", "--split", "train"], "--split, --greedy: for the policy of a checkpoint"),
        (["random", "--context", "5"], "--context: for an agent that asks a planner; random does not"),
        (["farmer", "--turns", "1"], "--turns: for the agent planner, not farmer"),
        (["shortest-path", "--control", "zeros"], "--control: for an agent that asks a planner"),
        (["shortest-path", "--planner", "embedded"], "--planner: for an agent that asks a planner"),
        (["walker", "--context", "5"], "there is no agent 'walker'"),
    ],
)
def test_what_would_change_nothing_for_an_agent_is_refused(options: list[str], words: str) -> None:
    done = CliRunner().invoke(app, ["eval", "--agent", *options])
    assert isinstance(done.exception, ConfigError)
    assert words in str(done.exception)


def test_a_result_lies_in_its_run_wherever_the_command_is_typed(
    checkpoint: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "[red]one"
    shutil.copytree(checkpoint.parents[1], run)
    for folder, path in ((run / "checkpoints", Path(checkpoint.name)), (run, Path("checkpoints") / checkpoint.name)):
        monkeypatch.chdir(folder)
        done = CliRunner().invoke(app, ["eval", str(path)])
        assert done.exit_code == 0, done.output
        (result,) = tmp_path.rglob("result.json")
        assert result == run / "evaluations" / f"{checkpoint.stem}-held_out" / "result.json"
        result.unlink()
    assert "episodes of held_out" in done.output


def test_a_report_names_homes_and_actions_and_tables_show_names_as_they_are(
    checkpoint: Path, tmp_path: Path, smoke: TrainConfig
) -> None:
    run = tmp_path / "[red]one"
    shutil.copytree(checkpoint.parents[1], run)
    copied = str(run / "checkpoints" / checkpoint.name)
    done = CliRunner().invoke(app, ["eval", copied, "--greedy"])
    assert done.exit_code == 0, done.output
    assert "[red]one" in done.output.replace("\n", "")
    assert (run / "evaluations" / f"{checkpoint.stem}-held_out-greedy" / "result.json").is_file()
    page = write_report(run).read_text()
    assert "after 64 steps, the likeliest actions" in page
    assert f"in {smoke.scenes.homes} home" in page
    result = json.loads(next(run.rglob("result.json")).read_text())
    assert result["protocol"]["actions"] == "greedy"
    assert CliRunner().invoke(app, ["compare", str(run), str(run)]).output.count("[red]one") == 2


def test_who_replaces_an_evaluation_that_was_made_otherwise_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    measures = dict.fromkeys(MEASURES, 0.0)
    records = [EpisodeRecord("e", "home-1", "chair", measures, {}, [[0.0] * 4], [0], [], None, "stuck")]
    for protocol in ({"control": "none", "clock": {"step": 0.5}}, {"clock": {"step": 0.5}, "control": "none"}):
        write_evaluation(tmp_path, protocol, records)
    assert not caplog.records
    write_evaluation(tmp_path, {"control": "zeros", "clock": {"step": 0.5}}, records)
    (told,) = caplog.records
    assert told.getMessage().endswith("held another evaluation, which is replaced; it differed in control")
