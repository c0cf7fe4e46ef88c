"""From nothing to weights and a card, in miniature, and the command that asks the shipped model."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from thinknav_models.subgoal_language import DIRECTIONS
from thinknav_models.subgoal_vlm import Question, SubgoalVLM
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
