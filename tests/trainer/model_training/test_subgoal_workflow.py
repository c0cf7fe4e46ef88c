"""From nothing to weights and a card, in miniature, and the command that asks the shipped model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from thinknav_models.subgoal_language import DIRECTIONS
from thinknav_models.subgoal_vlm import Question, SubgoalVLM
from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.scans.store import write_scene
from thinknav_sim.scene import SceneError
from thinknav_trainer.cli import app
from thinknav_trainer.config import ConfigError
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.subgoal_training import Schooling
from thinknav_trainer.model_training.subgoal_workflow import train_and_describe

SCHOOLING = Schooling(visits=2, batch=1, homes=2)


def test_it_leaves_weights_that_answer_and_a_card_that_names_them(tmp_path: Path) -> None:
    path = train_and_describe(tmp_path, SCHOOLING, (), "thinknav models train subgoal", Interruption(), 1, 2)
    assert path is not None
    model, revision = SubgoalVLM.load(path)
    (answer,) = model.answer([Question(np.zeros((128, 128, 3), np.uint8), "chair")])
    assert answer.sentences[0].startswith(DIRECTIONS)
    card = (tmp_path / "subgoal_vlm.md").read_text()
    assert f"subgoal-vlm@{revision}" in card
    assert "| several frames | another goal |" in card


def test_a_card_of_scans_says_so(tmp_path: Path) -> None:
    scan = tmp_path / "flat.npz"
    write_scene(scan, generate_home(home_seed("train", 0), rooms=1), ())
    schooling = replace(SCHOOLING, homes=1)
    assert train_and_describe(tmp_path / "out", schooling, [scan], "thinknav models train subgoal", Interruption())
    card = (tmp_path / "out" / "subgoal_vlm.md").read_text()
    assert "2 visits to flat.npz, some" in card
    assert "The stop gate was set in the same scans." in card
    assert "## Known, in the scans that it was taught in" in card
    assert "home" not in card.partition("## Limits")[0]
    assert "another frame" not in card


def test_a_scan_without_goals_is_refused_before_anything_is_taught(tmp_path: Path) -> None:
    scan = tmp_path / "bare.npz"
    home = generate_home(home_seed("train", 0), rooms=1)
    unnamed = replace(home, objects=(), triangle_objects=np.full_like(home.triangle_objects, -1))
    write_scene(scan, unnamed, ())
    with pytest.raises(SceneError, match=r"there is no way to any of chair, .*: nothing to ask"):
        train_and_describe(tmp_path / "out", SCHOOLING, [scan], "", Interruption())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", [["train", "subgoal"], ["evaluate", "subgoal"], ["evaluate", "clip"]])
def test_homes_beside_scans_are_refused(command: list[str]) -> None:
    result = CliRunner().invoke(app, ["models", *command, "--scans", "a.glb", "--homes", "9"])
    assert isinstance(result.exception, ConfigError)
    assert str(result.exception) == "--homes: scans are used in place of homes"


def test_interrupted_it_leaves_a_checkpoint_and_no_weights(tmp_path: Path) -> None:
    interruption = Interruption()
    interruption.request(2)
    assert train_and_describe(tmp_path, SCHOOLING, (), "", interruption) is None
    assert (tmp_path / "subgoal-training" / "checkpoint.pt").exists()
    assert not list(tmp_path.glob("*.safetensors"))


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "frame.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (64, 96, 3), dtype=np.uint8)).save(path)
    return path


def test_asking_tells_the_subgoal_its_confidence_and_what_is_near(picture: Path) -> None:
    result = CliRunner().invoke(app, ["ask", str(picture), "--goal", "sofa"])
    assert result.exit_code == 0, result.output
    subgoal, _, confidence, words, *_ = result.output.splitlines()
    assert subgoal.startswith(DIRECTIONS)
    assert confidence.startswith("confidence 0.")
    assert words.startswith(DIRECTIONS)
    assert len(result.output.partition("nearest descriptions:\n")[2].splitlines()) == 5


def test_a_plan_ends_by_stopping(picture: Path) -> None:
    result = CliRunner().invoke(app, ["ask", str(picture), "--plan"])
    sentences = result.output.partition("\n\n")[0].splitlines()
    assert sentences[-1].startswith("stop")


def test_what_is_no_picture_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "words.png").write_text("no picture")
    for name, words in (("words.png", "words.png is no picture"), ("nowhere.png", "there is no picture")):
        result = CliRunner().invoke(app, ["ask", str(tmp_path / name)])
        assert isinstance(result.exception, ConfigError)
        assert words in str(result.exception)
