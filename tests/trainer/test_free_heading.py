"""Which way is free: by depth, by bumps, from any heading."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.free_heading import FreeHeading

CONFIG = ObjectNavConfig(width=32, height=32)
FAR = np.ones((32, 32, 1), np.float32)
TURN = math.radians(CONFIG.turn_angle)


def wall(metres: float, columns: slice = slice(None)) -> np.ndarray:
    """Depth of a wall across some columns of the picture, and nothing beside it."""
    depth = FAR.copy()
    depth[:, columns] = (metres - CONFIG.min_depth) / (CONFIG.max_depth - CONFIG.min_depth)
    return depth


@settings(deadline=None)  # the first call loads the kernels
@given(st.floats(-math.pi, math.pi), st.floats(-3, 3), st.floats(-3, 3))
def test_an_empty_world_is_free_ahead(compass: float, ahead: float, right: float) -> None:
    free = FreeHeading(CONFIG)
    free.see(FAR, np.array([ahead, right]), compass)
    assert free.turns() == 0


@pytest.mark.parametrize(("columns", "sign"), [(slice(0, 20), -1), (slice(12, 32), 1)])
def test_around_a_wall_on_one_side_the_other_is_nearer(columns: slice, sign: int) -> None:
    free = FreeHeading(CONFIG)
    free.see(wall(0.7, columns), np.zeros(2), 0.0)
    assert free.turns() == 0  # far enough for a step
    free.see(FAR, np.array([0.4, 0.0]), 0.0)  # 30 cm before it
    turns = free.turns()
    assert turns is not None
    assert turns * sign > 0


def test_the_heading_is_free_once_the_turns_are_taken() -> None:
    free = FreeHeading(CONFIG)
    free.see(wall(0.6), np.zeros(2), 0.0)
    free.see(FAR, np.array([0.3, 0.0]), 0.0)
    turns = free.turns()
    assert turns
    free.see(FAR, np.array([0.3, 0.0]), turns * TURN)
    assert free.turns() == 0


def test_who_bumps_all_around_has_no_way() -> None:
    free = FreeHeading(CONFIG)
    for turn in range(36):
        free.see(FAR, np.zeros(2), turn * TURN)
        free.bump()
    assert free.turns() is None
