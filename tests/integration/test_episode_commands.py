"""`thinknav episodes` and `thinknav homes`: the main job in a process of its own, and users' mistakes."""

import gzip
import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from thinknav_trainer.cli import app
from thinknav_trainer.errors import exit_status

THINKNAV = str(Path(sys.executable).with_name("thinknav"))
FEW = ("--homes", "1", "--among", "2", "--rooms", "1", "--episodes", "20", "--output", "made")


def thinknav(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [THINKNAV, *arguments], cwd=folder, capture_output=True, text=True, timeout=240.0, check=False
    )


def invoke(*arguments: str) -> Result:
    """The command in this process, whose start takes seconds."""
    return CliRunner().invoke(app, arguments)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("episodes")
    process = thinknav(folder, "episodes", "make", *FEW)
    assert process.returncode == 0, process.stderr
    assert "held_out: made/held_out/held_out.json.gz" in process.stdout
    return folder


def test_what_make_makes_check_reads(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)
    result = invoke("episodes", "check", "made/train")
    assert result.exit_code == 0, result.output
    assert "18 episodes" in result.output
    assert "bed" in result.output


def test_a_mistake_is_one_line_and_status_2(made: Path) -> None:
    process = thinknav(made, "episodes", "make", *FEW)
    assert process.returncode == 2
    assert process.stderr == "thinknav: made is there already, and not an empty folder; give another --output\n"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("episodes", "make", "--homes", "3", "--among", "2", "--output", "new"), "--homes 3 cannot be chosen among 2"),
        (("episodes", "make", "--min-distance", "9", "--max-distance", "5", "--output", "new"), "--min-distance 9.0"),
        (("episodes", "make", "--max-distance", "inf", "--output", "new"), "--max-distance inf, a finite length"),
        (("episodes", "make", "--first-home", "999990", "--output", "new"), "beyond the last home, 999999"),
        (("episodes", "check", "nowhere.json.gz"), "nowhere.json.gz cannot be read"),
        (("homes", "show", "1", "--output", "made/homes.json"), "made/homes.json is not a folder"),
    ],
)
def test_mistakes_are_named(
    made: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], complaint: str
) -> None:
    monkeypatch.chdir(made)
    result = invoke(*arguments)
    assert isinstance(result.exception, Exception)
    assert exit_status(result.exception) == 2
    assert complaint in str(result.exception)


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("start_rotation", [0.0, 1.0], "field 'start_rotation[2]': field required"),
        ("object_category", "toilet", "has no goal with viewpoints"),
        ("info", {}, "info.geodesic_distance must be a number"),
    ],
)
def test_check_names_episode_and_field(made: Path, tmp_path: Path, key: str, value: object, complaint: str) -> None:
    (content,) = (made / "made/train/content").iterdir()
    document = json.loads(gzip.decompress(content.read_bytes()))
    document["episodes"][3][key] = value
    (tmp_path / "bad.json").write_text(json.dumps(document))
    result = invoke("episodes", "check", str(tmp_path / "bad.json"))
    assert isinstance(result.exception, Exception)
    assert exit_status(result.exception) == 2
    assert complaint in str(result.exception)
    assert repr(document["episodes"][3]["episode_id"]) in str(result.exception)


def test_show_writes_pictures(tmp_path: Path) -> None:
    result = invoke("homes", "show", "3", "--rooms", "1", "--output", str(tmp_path / "pictures"))
    assert result.exit_code == 0, result.output
    names = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert names == ["home-3-1-plan.png", *(f"home-3-1-view-{number}.png" for number in range(1, 5))]
