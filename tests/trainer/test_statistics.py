import numpy as np
import pytest

from thinknav_trainer.statistics import bootstrap_interval, student_interval


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


def test_students_interval_is_the_one_of_the_tables() -> None:
    assert student_interval([1.0, 2.0, 3.0]) == pytest.approx(
        (2 - 4.303 / np.sqrt(3), 2 + 4.303 / np.sqrt(3)), abs=1e-3
    )
    assert student_interval([0.5, 0.5]) == (0.5, 0.5)
    with pytest.raises(ValueError, match="at least two values, not 1"):
        student_interval([1.0])
