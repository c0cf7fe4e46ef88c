"""The subgoal VLM, untaught: what must hold whatever it has learnt."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from thinknav_models.subgoal_language import DIRECTIONS, Vocabulary
from thinknav_models.subgoal_network import NetworkConfig, SubgoalNetwork, ViewTrunk, fold_normalisation
from thinknav_models.subgoal_vlm import MAX_RECENT, MAX_SENTENCES, Answer, Question, SubgoalVLM, save

WORDS = ("chair", "sofa", "to", "the", "doorway", "toward", "past", "tv", "monitor")
GOALS = ("chair", "tv_monitor", "sofa")


def make_network(seed: int = 0) -> tuple[Vocabulary, SubgoalNetwork]:
    torch.manual_seed(seed)
    vocabulary = Vocabulary(WORDS)
    network = SubgoalNetwork(NetworkConfig(len(vocabulary), channels=(8, 8, 16), width=16, heads=2, layers=2))
    for parameter in network.parameters():
        if parameter.dim() > 1:
            parameter.data *= 3  # untaught answers would hardly depend on what is seen
    return vocabulary, network


def make_model(stop_gate: float = 0.9, seed: int = 0) -> SubgoalVLM:
    model = SubgoalVLM(*make_network(), stop_gate, seed)
    model.network.trunk.float()  # in half the digits, a batch and its parts may differ
    return model


def frame(seed: int, size: int = 128) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (size, size, 3), dtype=np.uint8)


def questions() -> list[Question]:
    return [
        Question(frame(0), "chair"),
        Question(frame(1), "tv_monitor", ((frame(2), 0.5),)),
        Question(frame(3), "sofa", tuple((frame(4 + number), 0.3 * number) for number in range(MAX_RECENT))),
        Question(frame(8), "chair", mode="plan"),
    ]


def same(one: Answer, other: Answer) -> None:
    assert one.sentences == other.sentences
    assert one.confidence == pytest.approx(other.confidence, abs=1e-4)


def test_a_batch_is_answered_as_its_questions_alone() -> None:
    model = make_model()
    together = model.answer(questions())
    for question, answer in zip(questions(), together, strict=True):
        same(model.answer([question])[0], answer)


def test_every_sentence_begins_with_a_direction_and_plans_have_few() -> None:
    model = make_model()
    asked = [dataclasses.replace(question, temperature=3.0) for question in questions() * 5]
    for question, answer in zip(asked, model.answer(asked), strict=True):
        assert all(sentence.startswith(DIRECTIONS) for sentence in answer.sentences)
        assert 1 <= len(answer.sentences) <= (MAX_SENTENCES if question.mode == "plan" else 1)


def test_stop_is_said_from_the_gate_on_and_never_below() -> None:
    asked = [Question(frame(seed), goal, temperature=2.0) for seed in range(6) for goal in GOALS]
    stop = make_model().directions(asked)[:, DIRECTIONS.index("stop")]
    gate = float(np.median(stop))
    said = [answer.sentences[0].startswith("stop") for answer in make_model(gate).answer(asked)]
    assert said == (stop >= gate).tolist()
    assert 0 < sum(said) < len(said)


def test_confidence_is_the_probability_of_the_direction() -> None:
    model = make_model(stop_gate=2.0)
    asked = questions()[:3]
    chances = model.directions(asked)
    for answer, row in zip(model.answer(asked), chances, strict=True):
        direction = next(number for number, words in enumerate(DIRECTIONS) if answer.sentences[0].startswith(words))
        # Among all tokens, not among directions alone: an untaught model thinks of other words there too.
        assert answer.confidence <= row[direction] + 1e-5
        assert answer.words[0] == (DIRECTIONS[direction], answer.confidence)


def test_a_temperature_draws_and_the_seed_repeats_it() -> None:
    asked = [Question(frame(0), "chair", temperature=2.0)] * 40
    drawn = make_model(stop_gate=2.0, seed=1).answer(asked)
    assert len({answer.sentences for answer in drawn}) > 1
    assert drawn == make_model(stop_gate=2.0, seed=1).answer(asked)
    assert drawn != make_model(stop_gate=2.0, seed=2).answer(asked)
    likeliest = make_model(stop_gate=2.0).answer([dataclasses.replace(asked[0], temperature=0.0)] * 3)
    assert len({answer.sentences for answer in likeliest}) == 1


@pytest.mark.parametrize(
    "other",
    [
        Question(frame(1), "sofa", ((frame(2), 0.5),)),
        Question(frame(9), "tv_monitor", ((frame(2), 0.5),)),
        Question(frame(1), "tv_monitor"),
        Question(frame(1), "tv_monitor", ((frame(2), -0.5),)),
        Question(frame(1), "tv_monitor", ((frame(7), 0.5),)),
    ],
    ids=["goal", "frame", "no earlier view", "its heading", "another earlier view"],
)
def test_everything_that_is_asked_counts(other: Question) -> None:
    before, after = make_model().directions([questions()[1], other])
    assert np.abs(before - after).max() > 1e-6


def test_of_many_earlier_views_the_latest_count() -> None:
    model = make_model()
    views = tuple((frame(number), 0.1 * number) for number in range(MAX_RECENT + 3))
    many, latest = model.directions([Question(frame(20), "chair", views), Question(frame(20), "chair", views[3:])])
    np.testing.assert_allclose(many, latest, atol=1e-6)


def test_a_frame_of_another_size_is_the_same_picture() -> None:
    model = make_model()
    large = frame(0).repeat(2, axis=0).repeat(2, axis=1)
    one, other = model.directions([Question(frame(0), "chair"), Question(large, "chair")])
    np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("sides", [(64, 64), (32, 128), (128, 16), (48, 64), (200, 256)])
def test_a_frame_is_scaled_by_areas(sides: tuple[int, int]) -> None:
    """A small one without averaging, which is the same where each area lies in one pixel."""
    model = make_model()
    pixels = np.random.default_rng(0).integers(0, 256, (*sides, 3), dtype=np.uint8)
    areas = functional.interpolate(torch.from_numpy(pixels).permute(2, 0, 1)[None].float(), (128, 128), mode="area")
    seen: list[Tensor] = []
    model.network.trunk.register_forward_pre_hook(lambda _, views: seen.append(views[0]))
    model.answer([Question(pixels, "chair")])
    assert torch.equal(seen[0].float(), areas.permute(0, 2, 3, 1))


@pytest.mark.parametrize(
    "wrong", [np.zeros((128, 128), np.uint8), np.zeros((128, 128, 3), np.float32), np.zeros((0, 4, 3), np.uint8)]
)
def test_what_is_no_image_is_refused(wrong: NDArray[np.uint8]) -> None:
    with pytest.raises(ValueError, match="frame must be"):
        make_model().answer([Question(wrong, "chair")])


def test_decoding_word_by_word_equals_decoding_at_once() -> None:
    _, network = make_network()
    network.eval()
    features = torch.randn(4, 16, 8, 8)
    memory = network.remember(features, torch.tensor([[0, 1, -1], [2, 3, 0]]), torch.tensor([[0.4, 0.0], [-1.0, 2.0]]))
    first = network.first_token(torch.tensor([5, 6, 7, 8, 9]), torch.tensor([1, 2, 1, 1]), torch.tensor([0, 0, 1, 0]))
    tokens = torch.randint(4, 12, (4, 6))
    with torch.no_grad():
        whole, _ = network.decode(first, tokens, memory)
        part, past = network.decode(first, tokens[:, :0], memory)
        for step in range(6):
            torch.testing.assert_close(part[:, -1], whole[:, step])
            part, past = network.decode(first, tokens[:, step : step + 1], memory, past)
    torch.testing.assert_close(part[:, -1], whole[:, 6])


def test_folding_leaves_the_features_as_they_are() -> None:
    torch.manual_seed(0)
    trunk = ViewTrunk((8, 16, 16))
    views = torch.randint(0, 256, (3, 128, 128, 3))
    for _ in range(3):
        trunk(views)  # moves the running statistics off their start
    for parameter in trunk.parameters():
        parameter.data += 0.1 * torch.randn_like(parameter)
    trunk.eval()
    with torch.no_grad():
        before = trunk(views)
        fold_normalisation(trunk)
        assert not any(isinstance(module, torch.nn.BatchNorm2d) for module in trunk.modules())
        torch.testing.assert_close(trunk(views), before, atol=1e-4, rtol=1e-4)


def test_a_model_of_very_many_updates_can_be_saved(tmp_path: Path) -> None:
    """Half precision counts to 65,504."""
    vocabulary, network = make_network()
    counts = [name for name in network.state_dict() if name.endswith("num_batches_tracked")]
    assert counts
    network.load_state_dict(network.state_dict() | dict.fromkeys(counts, torch.tensor(70_000)))
    save(tmp_path / "model.safetensors", vocabulary, network, 0.7)
    assert SubgoalVLM.load(tmp_path / "model.safetensors")


def test_a_saved_model_answers_as_before(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    revision = save(path, *make_network(), 0.7, homes=3)
    loaded, read = SubgoalVLM.load(path)
    assert read == revision
    assert loaded.stop_gate == 0.7
    loaded.network.trunk.float()
    chances = make_model().directions(questions()[:3])
    np.testing.assert_allclose(loaded.directions(questions()[:3]), chances, atol=0.02)  # weights are rounded
    assert math.isclose(float(chances[0].sum()), 1.0, abs_tol=1e-5)
