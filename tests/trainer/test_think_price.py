"""The price of a think under a budget: how it moves, and that it finds the budget."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from thinknav_sim.task_config import Action
from thinknav_trainer.config import ConfigError, ThinkConfig, load_config
from thinknav_trainer.forcing import FORCED_THINK
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.think_price import ThinkPrice, own_thinks
from thinknav_trainer.workers import Lone

COUNT = 1000


def rollout(thinks: float, forced: float | None = None, count: int = COUNT) -> Rollout:
    """A policy that thinks in this share of the steps that are its own, with f forced thinks beside."""
    f = forced or 0.0
    generator = torch.Generator().manual_seed(int(1e6 * thinks) + count)
    mixed = (1 - f) * thinks + f
    thought = torch.rand(count, generator=generator) < mixed
    nothing = torch.zeros(count)
    return Rollout(
        observations={} if forced is None else {FORCED_THINK: torch.full((count,), f)},
        actions=torch.where(thought, int(Action.THINK), int(Action.TURN_LEFT)),
        previous_actions=nothing.long(),
        log_probs=torch.where(thought, math.log(max(mixed, 1e-9)), math.log(max(1 - mixed, 1e-9))),
        values=nothing,
        advantages=nothing,
        returns=nothing,
        sequence_starts=np.zeros(1, np.int64),
        sequence_lengths=np.array([count]),
        sequence_hidden=torch.zeros(2, 1, 1, 1),
    )


def priced(workers: Lone = Lone(), **think: float) -> ThinkPrice:
    return ThinkPrice(ThinkConfig.model_validate({"budget": 0.05, "budget_lr": 0.01, **think}), workers)


def test_without_a_budget_the_price_is_the_cost() -> None:
    price = ThinkPrice(ThinkConfig(cost=0.03), Lone())
    assert price.update(rollout(0.9), 0.5) == {}
    assert price.now == 0.03
    price.load_state_dict({"now": 7.0})  # of a run whose think.cost was another
    assert price.now == 0.03


def test_the_price_rises_above_the_budget_and_falls_below_it() -> None:
    price = priced(cost=0.02)
    told = price.update(rollout(0.5), 0.0)
    assert told == {"think_price": pytest.approx(0.03), "own_think_rate": pytest.approx(0.5, abs=0.05)}
    for expected in (0.02, 0.01, 0.0, 0.0):
        price.update(rollout(0.0), 0.0)
        assert price.now == pytest.approx(expected, abs=1e-9)
    other = priced()
    other.load_state_dict(price.state_dict())
    assert other.now == price.now
    other = priced(cost=0.05)
    other.load_state_dict(ThinkPrice(ThinkConfig(cost=0.03), Lone()).state_dict())  # there was no budget yet
    assert other.now == 0.05


def test_the_price_waits_until_its_share_of_the_run_is_over() -> None:
    price = priced(budget_after=0.3)
    assert price.update(rollout(0.5), 0.29)["own_think_rate"] > 0.4
    assert price.now == 0.01
    price.update(rollout(0.5), 0.3)
    assert price.now == pytest.approx(0.02)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.floats(0, 1), max_size=20), st.floats(0.001, 0.999), st.floats(1e-4, 1))
def test_the_price_is_never_negative_and_never_leaps(rates: list[float], budget: float, lr: float) -> None:
    price = priced(budget=budget, budget_lr=lr)
    for rate in rates:
        before = price.now
        price.update(rollout(rate, count=50), 0.0)
        assert price.now >= 0
        assert abs(price.now - before) <= lr + 1e-12


def test_forced_thinks_are_not_the_policys_own() -> None:
    for forced in (None, 0.0, 0.3, 0.9):
        own, left = own_thinks(rollout(0.2, forced, count=200_000)).tolist()
        assert left == pytest.approx(200_000 * (1 - (forced or 0)))
        assert own / left == pytest.approx(0.2, abs=0.02)
    own, _ = own_thinks(rollout(0.0, 0.5)).tolist()
    assert own == pytest.approx(0, abs=1e-3)


def test_a_policy_that_weighs_the_price_ends_within_the_budget() -> None:
    """It thinks in half of its steps while that is free, and the less the dearer it is."""
    price = priced(cost=0.0, budget_lr=0.002)
    rate = 0.5
    for _ in range(300):
        rate = 0.5 * math.exp(-price.now / 0.03)
        price.update(rollout(rate), 0.0)
    assert rate == pytest.approx(0.05, abs=0.02)
    assert price.now == pytest.approx(0.03 * math.log(10), abs=0.015)


class Beside(Lone):
    """A worker beside another one, of which only the numbers are known."""

    count = 2

    def __init__(self, theirs: Tensor) -> None:
        self._theirs = theirs

    def sum(self, values: Tensor) -> Tensor:
        return values + self._theirs


def test_workers_go_by_the_thinks_and_steps_of_all() -> None:
    mine, theirs = rollout(0.2, count=100), rollout(0.0, count=900)
    together = own_thinks(mine) + own_thinks(theirs)
    prices = [priced(Beside(own_thinks(other)), budget=0.021) for other in (theirs, mine)]
    told = [price.update(own, 0.0) for price, own in zip(prices, (mine, theirs), strict=True)]
    assert told[0] == told[1]
    assert told[0]["own_think_rate"] == pytest.approx(float(together[0] / together[1]))
    assert told[0]["own_think_rate"] < 0.03  # a mean of the two rates would be 0.1


def test_the_likelier_a_think_was_forced_the_less_it_is_the_policys_own() -> None:
    shares = []
    for forced in (0.1, 0.5, 0.9):
        made = rollout(0.2, forced, count=1)
        probability = torch.tensor([forced + (1 - forced) * 0.2])
        made = replace(made, actions=torch.tensor([int(Action.THINK)]), log_probs=probability.log())
        shares.append(own_thinks(made)[0].item())
    assert shares == pytest.approx([0.18 / 0.28, 0.1 / 0.6, 0.02 / 0.92], abs=1e-6)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("think.strategy=every_n", "think.budget is for strategy agent, not every_n"),
        ("think.reward=task", "think.budget needs a reward scheme that charges thinks; task does not"),
        ("think.budget=1", "think.budget: .*less than 1"),
    ],
)
def test_budgets_that_cannot_be_kept_are_refused(override: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_config("smoke", overrides=["think.budget=0.1", override])
