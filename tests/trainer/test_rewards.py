import numpy as np
import pytest

from thinknav_trainer.config import ThinkConfig
from thinknav_trainer.rewards import REWARD_SCHEMES, ThinkStep

STEP = ThinkStep(thought=np.array([True, False, False, False]), agreement=np.array([0, 1, -1, 0], np.int8))


def test_task_adds_nothing() -> None:
    assert REWARD_SCHEMES["task"](STEP, ThinkConfig()) == {}


def test_think_cost_charges_thinking_alone() -> None:
    terms = REWARD_SCHEMES["think_cost"](STEP, ThinkConfig(cost=0.02))
    assert list(terms) == ["think_cost"]
    assert terms["think_cost"] == pytest.approx([-0.02, 0, 0, 0])


def test_paper_pays_agreement_and_charges_thinking() -> None:
    terms = REWARD_SCHEMES["paper"](STEP, ThinkConfig())
    assert terms["think_cost"] == pytest.approx([-0.01, 0, 0, 0])
    assert terms["agreement"] == pytest.approx([0, 0.1, -0.1, 0])
    assert all(term.dtype == np.float32 for term in terms.values())


def test_every_scheme_that_a_configuration_may_name_exists() -> None:
    names = ThinkConfig.model_fields["reward"].annotation.__args__  # type: ignore[union-attr]
    assert set(names) == set(REWARD_SCHEMES)
