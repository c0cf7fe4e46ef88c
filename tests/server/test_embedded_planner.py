"""The embedded planner, with a small untaught model: what is asked reaches it, what it says comes back."""

from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from thinknav_models.subgoal_language import DIRECTIONS, Vocabulary
from thinknav_models.subgoal_network import NetworkConfig, SubgoalNetwork
from thinknav_models.subgoal_vlm import Question, SubgoalVLM, save
from thinknav_models.weights import WeightsError
from thinknav_server.planners import PlanItem, View
from thinknav_server.planners.embedded import EmbeddedPlanner


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    torch.manual_seed(0)
    vocabulary = Vocabulary(("chair", "to", "the"))
    network = SubgoalNetwork(NetworkConfig(len(vocabulary), channels=(8, 8, 16), width=16, heads=2, layers=1))
    path = tmp_path / "weights.safetensors"
    save(path, vocabulary, network, 0.9)
    return path


def frame(seed: int) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (128, 128, 3), dtype=np.uint8)


def test_it_answers_as_its_model_does(weights: Path) -> None:
    planner = EmbeddedPlanner(weights)
    model, revision = SubgoalVLM.load(weights)
    items = [
        PlanItem(frame(0), "chair"),
        PlanItem(frame(1), "chair", recent=(View(frame(2), 0.5),)),
        PlanItem(frame(3), "chair", mode="plan"),
        PlanItem(frame(4), "chair", temperature=3.0),
    ]
    expected = model.answer(
        [
            Question(frame(0), "chair"),
            Question(frame(1), "chair", ((frame(2), 0.5),)),
            Question(frame(3), "chair", mode="plan"),
            Question(frame(4), "chair", temperature=3.0),
        ]
    )
    plans = planner.plan(items)
    assert [plan.instructions for plan in plans] == [answer.sentences for answer in expected]
    assert [plan.confidence for plan in plans] == [answer.confidence for answer in expected]
    assert all(plan.instructions[0].startswith(DIRECTIONS) for plan in plans)
    assert planner.identity.revision == revision


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match="nowhere"):
        EmbeddedPlanner(tmp_path / "nowhere.safetensors")
