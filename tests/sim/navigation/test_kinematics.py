"""Walking: straight, into walls, along walls."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thinknav_sim.navigation import GridTable, NavigationGrid
from thinknav_sim.navigation.kinematics import walk, wrap
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene

STEP = 0.25
CENTIMETRE = 0.01


@pytest.fixture(scope="module")
def grid(divided_room: Scene, renderer: Renderer) -> NavigationGrid:
    return NavigationGrid.from_scene(divided_room, renderer)


@pytest.mark.parametrize(
    ("heading", "dx", "dz"), [(0.0, 0, -1), (math.pi / 2, -1, 0), (math.pi, 0, 1), (-math.pi / 2, 1, 0)]
)
def test_forward_goes_along_the_heading(grid: NavigationGrid, heading: float, dx: int, dz: int) -> None:
    x, z, blocked = walk(GridTable.of([grid]), 0, 4.0, 1.5, heading, STEP, False)
    assert (x, z) == pytest.approx((4.0 + STEP * dx, 1.5 + STEP * dz))
    assert not blocked


@pytest.mark.parametrize("heading", [0.0, 0.3, -0.7, math.pi / 2 - 0.2])
@pytest.mark.parametrize("sliding", [False, True])
def test_walking_into_a_wall_ends_in_contact(grid: NavigationGrid, heading: float, sliding: bool) -> None:
    table = GridTable.of([grid])
    x, z, blocked = 3.0, 1.0, False
    for _ in range(20):
        if not blocked:
            x, z, blocked = walk(table, 0, x, z, heading, STEP, False)
    assert blocked
    assert grid.is_navigable(np.array([[x, 0.0, z]]))[0]
    ahead = np.array([[x - CENTIMETRE * math.sin(heading), 0.0, z - CENTIMETRE * math.cos(heading)]])
    assert not grid.is_navigable(ahead)[0]


def test_contact_with_a_wall_head_on(empty_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(empty_room, renderer)
    table = GridTable.of([grid])
    rim = grid.origin[1] + np.nonzero(grid.navigable.any(axis=1))[0][0] * grid.cell
    x, z, blocked = walk(table, 0, 3.0, rim + 0.1, 0.0, STEP, False)
    assert blocked
    assert x == 3.0
    assert rim <= z <= rim + CENTIMETRE


def test_sliding_goes_on_along_the_wall(empty_room: Scene, renderer: Renderer) -> None:
    table = GridTable.of([NavigationGrid.from_scene(empty_room, renderer)])
    heading = math.radians(30)
    x, z, blocked = walk(table, 0, 3.0, 0.3, heading, 2.0, True)
    stuck_x, stuck_z, _ = walk(table, 0, 3.0, 0.3, heading, 2.0, False)
    assert blocked
    assert x == pytest.approx(3.0 - 2.0 * math.sin(heading))
    assert x < stuck_x - 0.5
    assert z == pytest.approx(stuck_z)


def beside_a_wall(degrees: float) -> tuple[GridTable, NDArray[np.float64]]:
    """What lies this side of a straight wall through the origin, and the direction (x, z) into the wall."""
    into = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    x, z = np.meshgrid(*2 * [np.arange(-5.0, 5.0, 0.05) + 0.025])
    free = into[0] * x + into[1] * z <= 0
    return GridTable.of([NavigationGrid.from_mask("half", free, np.array([-5.0, -5.0]), 0.05)]), into


@pytest.mark.parametrize("wall", [0, 5, 15, 30, 45, 60, 75, 90, 200, 285])
def test_sliding_follows_a_wall_that_stands_at_any_angle(wall: int) -> None:
    table, into = beside_a_wall(wall)
    for incidence in (-80, -60, -45, -30, -10, 10, 30, 45, 60, 80):
        angle = math.radians(wall + incidence)
        heading = math.atan2(-math.cos(angle), -math.sin(angle))
        x, z = -0.05 * into
        for _ in range(8):
            x, z, _ = walk(table, 0, x, z, heading, STEP, True)
        along = math.copysign(1, incidence) * (z * into[0] - x * into[1])
        wanted = 8 * STEP * abs(math.sin(math.radians(incidence)))
        assert along >= (0.8 if abs(incidence) >= 30 else 0.0) * wanted, f"at {incidence} degrees"
        assert along <= wanted + 0.2, f"at {incidence} degrees"


def test_sliding_leads_through_a_passage_of_one_cell() -> None:
    mask = np.zeros((40, 5), np.bool_)
    mask[:, 2] = True
    table = GridTable.of([NavigationGrid.from_mask("passage", mask, np.zeros(2), 0.05)])
    _, z, blocked = walk(table, 0, 0.125, 1.0, math.radians(30), 0.5, True)
    assert blocked
    assert z == pytest.approx(1.0 - 0.5 * math.cos(math.radians(30)), abs=2 * CENTIMETRE)


@settings(deadline=None, max_examples=200)
@given(
    seed=st.integers(0, 2**31),
    heading=st.floats(-math.pi, math.pi),
    length=st.floats(0.01, 3.0),
    sliding=st.booleans(),
)
def test_nobody_walks_out_or_farther_than_asked(
    grid: NavigationGrid, seed: int, heading: float, length: float, sliding: bool
) -> None:
    start = grid.random_navigable(np.random.default_rng(seed), 1)[0]
    x, z, blocked = walk(GridTable.of([grid]), 0, start[0], start[2], heading, length, sliding)
    assert grid.is_navigable(np.array([[x, 0.0, z]]))[0]
    covered = math.hypot(x - start[0], z - start[2])
    assert covered <= length + 1e-9
    assert blocked or covered == pytest.approx(length)


@given(st.floats(-100.0, 100.0))
def test_wrap_gives_the_same_angle(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi - 1e-12 <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_wrap_includes_pi_and_not_minus_pi() -> None:
    assert wrap(math.pi) == wrap(-math.pi) == math.pi
