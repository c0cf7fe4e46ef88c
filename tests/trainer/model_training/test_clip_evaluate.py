"""The evaluation of the small CLIP can tell a good one from a bad one; and the command writes weights and card."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from thinknav_models.clip import ClipTextEncoder
from thinknav_models.clip.text import CLIP_WEIGHTS, shipped_text_encoder
from thinknav_sim.homes import SEEDS, generate_home, home_seed
from thinknav_sim.scans.store import write_scene
from thinknav_trainer.cli import app
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.clip_evaluate import _nearest_is_own, _ranks, direction_gap, evaluation_frames
from thinknav_trainer.model_training.clip_examples import write_examples
from thinknav_trainer.model_training.clip_train import ClipTraining
from thinknav_trainer.model_training.clip_workflow import evaluate_weights, evaluation_plan, train_and_describe
from thinknav_trainer.model_training.frames import HomeSource


def test_ranks_count_what_comes_before_the_right_one() -> None:
    rng = np.random.default_rng(0)
    images = rng.normal(size=(200, 16)).astype(np.float32)
    assert (_ranks(images, images.copy()) == 0).mean() > 0.95
    assert _ranks(images, rng.normal(size=(200, 16)).astype(np.float32)).mean() == pytest.approx(49.5, abs=6)
    blank = np.repeat(images[:1], 200, axis=0)
    assert _ranks(images, blank).mean() == 49.5  # ties count as chance would have it


def test_directions_that_lie_together_are_found_out() -> None:
    apart = np.repeat(np.eye(4, dtype=np.float32)[:, None], 3, axis=1)
    assert _nearest_is_own(apart).all()
    rng = np.random.default_rng(0)
    assert _nearest_is_own(rng.normal(size=(4, 50, 8)).astype(np.float32)).mean() < 0.5
    gap = direction_gap(lambda texts: np.full((len(texts), 4), 0.5, np.float32))
    assert gap.same == gap.other == gap.closest == 1.0


def test_the_shipped_weights_keep_directions_apart() -> None:
    gap = direction_gap(shipped_text_encoder().encode)
    assert gap.sorted_right > 0.99
    assert gap.same > gap.other + 0.2


def test_the_shipped_weights_beat_the_controls() -> None:
    measures, _ = evaluate_weights(CLIP_WEIGHTS, homes=10)
    by_name = {measure.name: measure for measure in measures}
    for control in ("blank frame", "another frame", "text prior"):
        assert by_name["frame to sentence, R@5"].low > by_name[f"control: {control}, R@5"].high
    assert by_name["its sentence over the same one mirrored"].low > 0.6


def test_evaluation_frames_are_of_validation_homes() -> None:
    plan = evaluation_plan(homes=5)
    assert isinstance(plan.source, HomeSource)
    assert plan.source.scene(0).name == f"home-{SEEDS['val'].start}"
    frames = evaluation_frames(plan)
    assert frames.rgb.shape == (500, 128, 128, 3)
    assert all(len(np.unique(frames.scenes[start : start + 100])) == 5 for start in range(0, 500, 100))


def test_training_writes_weights_and_a_card(tmp_path: Path) -> None:
    """With a worker process, as people run it."""
    path = train_and_describe(
        tmp_path, tmp_path / "checkpoints", ClipTraining(1), (), "the command", Interruption(), evaluation_homes=2
    )
    assert path == tmp_path / "clip.safetensors"
    encoder = ClipTextEncoder.load(path)
    card = (tmp_path / "clip.md").read_text()
    assert str(encoder.space) in card
    assert "| frame to sentence, R@1 |" in card
    assert "    the command\n" in card
    assert "128 frames of 8 procedural homes" in card


def test_examples_are_pictures_and_a_page(tmp_path: Path) -> None:
    page = write_examples(tmp_path, CLIP_WEIGHTS, homes=2)
    assert page.read_text().count("![frame") == 10
    with Image.open(tmp_path / "clip-9.png") as picture:
        assert picture.size == (128, 128)


def test_the_command_refuses_a_file_for_a_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = CliRunner().invoke(app, ["models", "train", "clip", "--output", str(tmp_path / "file")])
    assert "is not a folder" in str(done.exception)


def test_the_command_names_weights_that_are_none(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["models", "evaluate", "clip", "--weights", str(tmp_path / "none.safetensors")])
    assert "there is no file of weights" in str(done.exception)


def test_where_nothing_stands_to_one_side_mirrored_sentences_are_not_measured(tmp_path: Path) -> None:
    scan = tmp_path / "bare.npz"
    home = generate_home(home_seed("train", 0), rooms=1)
    unnamed = replace(home, objects=(), triangle_objects=np.full_like(home.triangle_objects, -1))
    write_scene(scan, unnamed, ())
    measures, _ = evaluate_weights(CLIP_WEIGHTS, [scan])
    names = [measure.name for measure in measures]
    assert "its sentence over the same one mirrored" not in names
    assert "subgoal over one of another direction" in names
