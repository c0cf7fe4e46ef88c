import numpy as np
import pytest

from thinknav_trainer.statistics import bootstrap_interval


def test_interval_holds_the_mean_and_narrows_with_more_values() -> None:
    rng = np.random.default_rng(0)
    few, many = rng.normal(3, 1, 20).tolist(), rng.normal(3, 1, 2000).tolist()
    (few_low, few_high), (low, high) = bootstrap_interval(few), bootstrap_interval(many)
    assert few_low < np.mean(few) < few_high
    assert high - low < (few_high - few_low) / 5
    # The normal approximation: 1.96 standard errors either side.
    assert (high - low) / 2 == pytest.approx(1.96 / np.sqrt(2000), rel=0.15)


def test_no_values_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one value"):
        bootstrap_interval([])
