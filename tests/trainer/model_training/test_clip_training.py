"""Training the small CLIP: batches that follow from their number, weights that ship what was trained, resuming."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from thinknav_models.clip import ClipTextEncoder
from thinknav_models.clip.image import ClipImageEncoder
from thinknav_models.clip.tokens import Vocabulary
from thinknav_models.weights import WeightsError
from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training import clip_train
from thinknav_trainer.model_training.clip_data import (
    FALSE,
    KINDS,
    NO_DIRECTION,
    SUBGOAL,
    ClipBatch,
    clip_batch,
    word_numbers,
)
from thinknav_trainer.model_training.clip_loss import ClipLoss
from thinknav_trainer.model_training.clip_towers import PADDING
from thinknav_trainer.model_training.clip_train import (
    ClipModel,
    ClipTraining,
    learning_rate,
    train_clip,
    vocabulary_for,
)
from thinknav_trainer.model_training.frames import FrameMaker, FramePlan, HomeSource


class OneRoom:
    """Homes of one room, which take little time to make."""

    def scene(self, index: int) -> Scene:
        return generate_home(home_seed("planner", index), rooms=1)


PLAN = FramePlan(OneRoom(), ObjectNavConfig(), 0, scenes_per_batch=2, frames_per_scene=3, batches_per_scene=2)
VOCABULARY = vocabulary_for(("goldfish_bowl",))


@pytest.fixture(scope="module")
def batches() -> list[ClipBatch]:
    maker = FrameMaker(PLAN)
    return [clip_batch(maker, Vocabulary(VOCABULARY), index) for index in range(3)]


def test_a_batch_follows_from_its_number(batches: list[ClipBatch]) -> None:
    again = clip_batch(FrameMaker(PLAN), Vocabulary(VOCABULARY), 2)
    assert torch.equal(again.rgb, batches[2].rgb)
    assert torch.equal(again.same, batches[2].same)
    assert all(torch.equal(a, b) for a, b in zip(again.words, batches[2].words, strict=True))
    assert not torch.equal(again.rgb, batches[1].rgb)


def test_a_batch_is_whole(batches: list[ClipBatch]) -> None:
    batch = batches[0]
    assert batch.rgb.shape == (6, 128, 128, 3)
    assert batch.rgb.dtype == torch.uint8
    assert len(batch.words) == KINDS
    assert all((numbers >= PADDING).all() and (numbers[:, 0] >= 0).all() for numbers in batch.words)
    assert batch.same.shape == batch.directions.shape == (KINDS, 6)
    assert (batch.directions[SUBGOAL] < NO_DIRECTION).all()
    assert (batch.directions[:SUBGOAL] == NO_DIRECTION).all()


def test_homes_come_from_the_planner_seeds() -> None:
    assert HomeSource("planner").scene(0).name == "home-1000000"


def test_what_ships_is_what_was_trained(batches: list[ClipBatch], tmp_path: Path) -> None:
    torch.manual_seed(0)
    model = ClipModel(VOCABULARY)
    for batch in batches:  # so that batch norms have seen something
        model(batch)
    revision = model.save(tmp_path / "clip.safetensors")
    model.eval()
    with torch.no_grad():
        images = torch.nn.functional.normalize(model.image(batches[0].rgb))
        texts = torch.nn.functional.normalize(
            model.text(word_numbers(["turn left to the sofa", "a bed"], Vocabulary(VOCABULARY)))
        )
    image_encoder = ClipImageEncoder.load(tmp_path / "clip.safetensors", torch.float32)
    text_encoder = ClipTextEncoder.load(tmp_path / "clip.safetensors")
    assert image_encoder.space == text_encoder.space
    assert text_encoder.space.revision == revision
    torch.testing.assert_close(image_encoder.encode(batches[0].rgb), images, atol=5e-3, rtol=0)
    np.testing.assert_allclose(text_encoder.encode(["turn left to the sofa", "a bed"]), texts.numpy(), atol=2e-3)


def test_the_loss_knows_true_from_false(batches: list[ClipBatch]) -> None:
    """Embeddings of sentences that equal their frames' cost less than those of any other frame's, or of false ones."""
    torch.manual_seed(0)
    batch = replace(batches[0], same=torch.arange(KINDS * 6).view(KINDS, 6))
    loss, images = ClipLoss(), torch.randn(6, 512)
    other = torch.randn(6, 512)

    def cost(true: Tensor, false: Tensor) -> float:
        texts = torch.stack([false if kind == FALSE else true for kind in range(KINDS)])
        return float(loss(images, texts, batch)[0].detach())

    assert cost(images, other) < cost(images.roll(1, 0), other)
    assert cost(images, other) < cost(images, images)


def test_equal_sentences_are_not_told_apart(batches: list[ClipBatch]) -> None:
    torch.manual_seed(0)
    loss, images, texts = ClipLoss(), torch.randn(6, 512), torch.randn(KINDS, 6, 512)
    apart = replace(batches[0], same=torch.arange(KINDS * 6).view(KINDS, 6))
    equal = replace(batches[0], same=torch.zeros(KINDS, 6, dtype=torch.int64))
    texts[:] = texts[:, :1]
    assert float(loss(images, texts, equal)[0].detach()) < float(loss(images, texts, apart)[0].detach())


def test_a_training_goes_on_where_it_stopped(
    batches: list[ClipBatch], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def made(plan: FramePlan, vocabulary: tuple[str, ...], start: int) -> object:
        torch.randint(9, ())  # as a loader does, when its processes begin
        return iter([batches[index % 3] for index in range(start, start + 10)])

    monkeypatch.setattr(clip_train, "clip_batches", made)
    training = ClipTraining(4, warmup=1, decay=0.5, checkpoint_every=2, log_every=1)
    whole = train_clip(PLAN, training, VOCABULARY, tmp_path / "whole", Interruption())
    interrupted = Interruption()
    monkeypatch.setattr(clip_train, "clip_batches", stopping(made, interrupted, after=2))
    train_clip(PLAN, training, VOCABULARY, tmp_path / "stopped", interrupted)
    assert interrupted.requested
    monkeypatch.setattr(clip_train, "clip_batches", made)
    resumed = train_clip(PLAN, training, VOCABULARY, tmp_path / "stopped", Interruption())
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name
    lines = (tmp_path / "stopped" / "metrics.jsonl").read_text().splitlines()
    assert len(lines) == 4
    with pytest.raises(WeightsError, match="is of a training with other settings"):
        train_clip(replace(PLAN, seed=1), training, VOCABULARY, tmp_path / "whole", Interruption())
    for batches_in_all, words in ((8, "has seen 4 of 4 batches, too many to make 8 of them"), (3, "seen 4 batches")):
        other = replace(training, batches=batches_in_all)
        with pytest.raises(WeightsError, match=words):
            train_clip(PLAN, other, VOCABULARY, tmp_path / "whole", Interruption())


def stopping(made, interruption: Interruption, after: int):  # type: ignore[no-untyped-def]
    """Batches that ask for an end while the one before `after` is made."""

    def batches(plan: FramePlan, vocabulary: tuple[str, ...], start: int):  # type: ignore[no-untyped-def]
        for number, batch in enumerate(made(plan, vocabulary, start), 1):
            if number == after:
                interruption.request(2)
            yield batch

    return batches


def test_the_learning_rate_rises_stays_and_falls() -> None:
    training = ClipTraining(100, learning_rate=1.0, warmup=10, decay=0.2)
    rates = [learning_rate(training, done) for done in range(100)]
    assert rates[0] == pytest.approx(0.1)
    assert rates[9] == rates[50] == rates[80] == 1.0
    assert rates[90] == pytest.approx(0.5)
    assert rates[99] == pytest.approx(0.05)


def test_strange_categories_join_the_vocabulary() -> None:
    assert {"goldfish", "bowl", "bowls"} <= set(VOCABULARY)
    with pytest.raises(ValueError, match="no word of 'xyzzy' is in the vocabulary"):
        word_numbers(["xyzzy"], Vocabulary(VOCABULARY))
