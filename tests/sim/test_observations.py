"""Sensors against values worked out by hand; a wrong sign anywhere breaks one of these."""

import math

import numpy as np
import pytest

from thinknav_sim.observations import compass, gps, observation_space
from thinknav_sim.task_config import ObjectNavConfig


@pytest.mark.parametrize(
    ("heading", "moved", "expected"),
    [
        (0.0, (0.0, -2.0), (2.0, 0.0)),  # faces -z and went there: forward
        (0.0, (2.0, 0.0), (0.0, 2.0)),  # +x is to the right
        (math.pi / 2, (-2.0, 0.0), (2.0, 0.0)),  # turned left, it faces -x
        (math.pi / 2, (0.0, -2.0), (0.0, 2.0)),
        (math.pi, (0.0, 1.0), (1.0, 0.0)),
        (-math.pi / 2, (0.0, 3.0), (0.0, 3.0)),
    ],
)
def test_gps(heading: float, moved: tuple[float, float], expected: tuple[float, float]) -> None:
    start = np.array([[1.0, 0.0, 2.0, heading]])
    pose = np.array([[1.0 + moved[0], 0.3, 2.0 + moved[1], 0.7]])
    np.testing.assert_allclose(gps(pose, start), [expected], atol=1e-6)


@pytest.mark.parametrize(
    ("start", "now", "expected"),
    [
        (0.0, math.radians(30), 0.5236),
        (0.0, math.radians(-30), -0.5236),
        (3.0, -3.0, 2 * math.pi - 6.0),
        (1.0, 1.0, 0.0),
    ],
)
def test_compass(start: float, now: float, expected: float) -> None:
    turned = compass(np.array([[0.0, 0.0, 0.0, now]]), np.array([[5.0, 0.0, 1.0, start]]))
    np.testing.assert_allclose(turned, [[expected]], atol=1e-4)


def test_the_space_has_the_configured_size() -> None:
    space = observation_space(ObjectNavConfig(width=32, height=24))
    assert space["rgb"].shape == (24, 32, 3)
    assert space["depth"].shape == (24, 32, 1)
