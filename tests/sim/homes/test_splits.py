"""Training, validation and planner-training homes never meet."""

import itertools
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_sim.homes import SEEDS, Split, home_seed


def test_splits_cannot_meet() -> None:
    assert set(SEEDS) == {"train", "val", "planner"}
    for first, second in itertools.combinations(SEEDS.values(), 2):
        assert first.step == second.step == 1
        assert first.stop <= second.start or second.stop <= first.start


@given(st.sampled_from(list(SEEDS)), st.integers(0, len(SEEDS["train"]) - 1))
@settings(deadline=None, max_examples=100)
def test_seeds_stay_in_their_split(split: Split, index: int) -> None:
    seed = home_seed(split, index)
    assert [name for name, seeds in SEEDS.items() if seed in seeds] == [split]
    assert seed == home_seed(split, 0) + index


@pytest.mark.parametrize("index", [-1, len(SEEDS["val"])])
def test_refuses_homes_beyond_the_split(index: int) -> None:
    with pytest.raises(ValueError, match=f"split 'val' has homes 0 to {len(SEEDS['val']) - 1}, not {index}"):
        home_seed("val", index)


def test_refuses_unknown_split() -> None:
    name: Any = "test"
    with pytest.raises(ValueError, match="unknown split 'test'; choose one of train, planner, val"):
        home_seed(name, 0)
