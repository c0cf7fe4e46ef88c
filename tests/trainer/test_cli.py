"""The `thinknav` command itself: what it imports, and what becomes of errors."""

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from thinknav_models.weights import WeightsError
from thinknav_proto import Unavailable
from thinknav_sim import EpisodeError
from thinknav_trainer.cli import COMMANDS, app, main
from thinknav_trainer.config import ConfigError
from thinknav_trainer.dumps import TrainingDiverged
from thinknav_trainer.errors import exit_status


def test_help_waits_for_nothing_heavy() -> None:
    program = (
        "import sys; from thinknav_trainer.cli import app; app(['--help'], standalone_mode=False); "
        "print(sorted({'torch', 'numba', 'matplotlib', 'gymnasium'} & sys.modules.keys()))"
    )
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120)
    assert told.stdout.splitlines()[-1] == "[]"
    assert all(name in told.stdout for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_is_there(name: str) -> None:
    told = CliRunner().invoke(app, [name, "--help"])
    assert told.exit_code == 0
    assert f" {name} [OPTIONS]" in told.output
    assert "completion" not in told.output


def test_a_name_mistyped_is_told_the_right_one() -> None:
    told = CliRunner().invoke(app, ["trian"])
    assert told.exit_code == 2
    assert "Did you mean 'train'?" in told.output


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (ConfigError("a"), 2),
        (EpisodeError("a"), 2),
        (WeightsError("a"), 2),
        (Unavailable("a"), 1),
        (TrainingDiverged("a"), 1),
        (ValueError("a"), None),
        (RuntimeError("a"), None),
    ],
)
def test_what_an_error_means(error: Exception, status: int | None) -> None:
    assert exit_status(error) == status


def test_a_users_mistake_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["thinknav", "reproduce", "nothing"])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("thinknav: there is single, five, unseen to reproduce, not 'nothing'")


def test_a_file_in_the_way_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "runs").write_text("no folder")
    options = ["--name", "a", "--runs", str(tmp_path / "runs"), "--set", "think.strategy=never"]
    monkeypatch.setattr(sys, "argv", ["thinknav", "train", "--preset", "smoke", *options])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"thinknav: {tmp_path}/runs/a: Not a directory"


def test_a_mistake_of_ours_shows_where(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thinknav_trainer.cli.app", lambda: [].pop())
    with pytest.raises(IndexError):
        main()
