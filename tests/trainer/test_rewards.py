from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_trainer.config import ThinkConfig
from thinknav_trainer.rewards import REWARD_SCHEMES, ThinkStep

STEP = ThinkStep(
    thought=np.array([True, False, False, False, False]),
    agreement=np.array([0, 1, -1, 0, 1], np.int8),
    standing_before=np.array([0, 0, 1, 1, 0], np.int8),
    standing=np.array([0, 1, -1, 1, 0], np.int8),  # the last one stopped
    progress=np.array([0, 0.25, 0.25, 0, 0], np.float32),
    price=0.01,
    share=0.3,
    discount=0.9,
)


def test_task_adds_nothing() -> None:
    assert REWARD_SCHEMES["task"](STEP, ThinkConfig()) == {}


def test_think_cost_charges_thinking_alone() -> None:
    terms = REWARD_SCHEMES["think_cost"](replace(STEP, price=0.02), ThinkConfig())
    assert list(terms) == ["think_cost"]
    assert terms["think_cost"] == pytest.approx([-0.02, 0, 0, 0, 0])


@pytest.mark.parametrize(
    ("scheme", "agreement"),
    [
        ("paper", [0, 0.1, -0.1, 0, 0.1]),
        ("annealed", [0, 0.05, -0.05, 0, 0.05]),  # half way to bonus_until
        ("capped", [0, 0.01, -0.01, 0, 0.01]),
        ("progress_gated", [0, 0.1, -0.1, 0, 0]),  # the last one came no nearer
        ("potential", [0, 0.09, -0.19, -0.01, 0]),
    ],
)
def test_schemes_pay_agreement_and_charge_thinking(scheme: str, agreement: list[float]) -> None:
    terms = REWARD_SCHEMES[scheme](STEP, ThinkConfig())
    assert terms["think_cost"] == pytest.approx([-0.01, 0, 0, 0, 0])
    assert terms["agreement"] == pytest.approx(agreement)
    assert all(term.dtype == np.float32 for term in terms.values())


def test_the_annealed_bonus_is_gone_at_the_end() -> None:
    for share in (0.6, 1.0):
        assert not REWARD_SCHEMES["annealed"](replace(STEP, share=share), ThinkConfig())["agreement"].any()


@settings(deadline=None, max_examples=50)
@given(agreements=st.lists(st.integers(-1, 1), min_size=1, max_size=20))
def test_a_potential_pays_nothing_over_an_episode(agreements: list[int]) -> None:
    """Discounted and summed up to the stop, whatever was agreed with on the way."""
    total, standing = 0.0, 0
    for t, agreement in enumerate(agreements):
        after = 0 if t == len(agreements) - 1 else agreement or standing
        agreed, before, now = (np.array([value], np.int8) for value in (agreement, standing, after))
        step = ThinkStep(np.array([False]), agreed, before, now, np.zeros(1, np.float32), 0.01, share=0.0, discount=0.9)
        total += 0.9**t * float(REWARD_SCHEMES["potential"](step, ThinkConfig())["agreement"][0])
        standing = after
    assert total == pytest.approx(0, abs=1e-6)


def test_to_think_and_agree_for_ever_earns_nothing_when_capped() -> None:
    terms = REWARD_SCHEMES["capped"](replace(STEP, price=0.02), ThinkConfig(agreement_bonus=0.5))
    assert terms["think_cost"][0] + terms["agreement"][1] <= 0


def test_every_scheme_that_a_configuration_may_name_exists() -> None:
    names = ThinkConfig.model_fields["reward"].annotation.__args__  # type: ignore[union-attr]
    assert set(names) == set(REWARD_SCHEMES)
