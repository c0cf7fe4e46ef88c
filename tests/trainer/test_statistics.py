import numpy as np
import pytest

from thinknav_trainer.statistics import bootstrap_interval, compare_means, student_interval


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


def test_a_ratio_over_seeds_has_the_interval_of_both() -> None:
    rng = np.random.default_rng(0)
    ours, theirs = rng.normal(3, 0.3, 50).tolist(), rng.normal(1, 0.1, 50).tolist()
    mean, low, high = compare_means(ours, theirs, ratio=True)
    assert mean == pytest.approx(np.mean(ours) / np.mean(theirs))
    assert low is not None
    assert high is not None
    # The delta method: relative variances add.
    deviation = 3 * np.sqrt(0.1**2 / 50 + 0.1**2 / 50)
    assert (high - low) / 2 == pytest.approx(1.96 * deviation, rel=0.2)
    above = compare_means(ours, theirs, ratio=False)
    assert above[0] == pytest.approx(np.mean(ours) - np.mean(theirs))
    assert compare_means(ours, theirs, ratio=True) == (mean, low, high)


def test_a_ratio_over_a_baseline_of_zero_has_no_bound() -> None:
    assert compare_means([0.5, 0.6], [0.0, 0.0], ratio=True) == (None, None, None)
    mean, low, high = compare_means([0.5, 0.6], [0.0, 0.0, 0.1], ratio=True)
    assert mean == pytest.approx(16.5)
    assert low == pytest.approx(5.5, abs=0.6)  # all of theirs drawn from the third
    assert high is None
    assert compare_means([0.5], [0.25, 0.25], ratio=True) == (2.0, None, None)
    assert compare_means([0.5], [0.25], ratio=False) == (0.25, None, None)
    with pytest.raises(ValueError, match="at least one value on either side"):
        compare_means([], [1.0], ratio=True)
