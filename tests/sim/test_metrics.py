"""SPL and SoftSPL against numbers worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thinknav_sim.metrics import path_efficiency, soft_spl, spl, success_weighted_by_time

LENGTH = st.floats(0.0, 100.0)


@pytest.mark.parametrize(
    ("success", "shortest", "travelled", "expected"),
    [
        (1, 4.0, 5.0, 0.8),
        (0, 4.0, 5.0, 0.0),
        (1, 4.0, 4.0, 1.0),
        (1, 4.0, 3.5, 1.0),
        (1, 0.0, 0.0, 1.0),
        (1, 0.0, 2.0, 0.0),
    ],
)
def test_spl(success: int, shortest: float, travelled: float, expected: float) -> None:
    assert spl(success, shortest, travelled) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("distance", "shortest", "travelled", "expected"),
    [
        (1.0, 4.0, 5.0, 0.75 * 0.8),
        (0.0, 4.0, 4.0, 1.0),
        (4.0, 4.0, 0.0, 0.0),
        (6.0, 4.0, 2.0, 0.0),
        (0.0, 0.0, 0.0, 1.0),
        (0.5, 0.0, 0.5, 0.0),
    ],
)
def test_soft_spl(distance: float, shortest: float, travelled: float, expected: float) -> None:
    assert soft_spl(distance, shortest, travelled) == pytest.approx(expected)


def test_arrays_are_scored_element_by_element() -> None:
    np.testing.assert_allclose(path_efficiency([4.0, 0.0, 2.0], [5.0, 0.0, 1.0]), [0.8, 1.0, 1.0])


@given(distance=LENGTH, shortest=LENGTH, travelled=LENGTH)
def test_scores_lie_between_0_and_1(distance: float, shortest: float, travelled: float) -> None:
    assert 0.0 <= soft_spl(distance, shortest, travelled) <= 1.0
    assert 0.0 <= spl(True, shortest, travelled) <= 1.0


def test_sot_pays_for_time_only_on_success() -> None:
    assert success_weighted_by_time([1, 1, 1, 0], [10.0] * 4, [10.0, 20.0, 8.0, 10.0]).tolist() == [1.0, 0.5, 1.0, 0.0]
