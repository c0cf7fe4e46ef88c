"""The map that an agent makes: what stands where it is seen to stand, whichever way the agent has turned since."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thinknav_sim.observations import compass, gps
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.obstacle_kernels import BLOCKED, FREE, UNKNOWN
from thinknav_trainer.occupancy import CELL_M, OccupancyMap, ahead_of, map_pose

CONFIG = ObjectNavConfig(width=64, height=64)
START = np.zeros(4)
HEADINGS = st.floats(-math.pi, math.pi)
PLACES = st.tuples(st.floats(-10, 10), st.floats(-10, 10))


def picture(metres: float) -> NDArray[np.float32]:
    """A wall across the whole view, this far ahead."""
    read = np.clip((metres - CONFIG.min_depth) / (CONFIG.max_depth - CONFIG.min_depth), 0, 1)
    return np.full((64, 64, 1), read, np.float32)


def empty_floor() -> NDArray[np.float32]:
    """A level floor without end, and nothing on it."""
    below = (np.arange(64) + 0.5 - 32) / 32 * math.tan(math.radians(CONFIG.hfov) / 2)
    metres = np.where(below > 0, CONFIG.camera_height / np.maximum(below, 1e-6), np.inf)
    read = np.clip((metres - CONFIG.min_depth) / (CONFIG.max_depth - CONFIG.min_depth), 0, 1)
    return np.broadcast_to(read[:, None, None], (64, 64, 1)).astype(np.float32)


def states(known: OccupancyMap, pose: NDArray[np.float64], left: float, *forward: float) -> list[int]:
    """What the map says of places so far to the left and ahead of a pose."""
    ahead = np.array(forward)
    return [int(state) for state in known.state[known.cells(ahead_of(pose, np.full(len(ahead), left), ahead))]]


@settings(deadline=None, max_examples=25)
@given(PLACES, HEADINGS, st.floats(0.7, 4.8))
def test_a_look_frees_what_lies_before_a_wall_and_blocks_where_it_stands(
    place: tuple[float, float], heading: float, metres: float
) -> None:
    known = OccupancyMap(CONFIG)
    pose = np.array([place[0], 0.0, place[1], heading])
    known.look(picture(metres), pose)
    for left in (0.0, 0.4 * metres, -0.4 * metres):  # the view is 0.82 wide to each side at 1 m
        before = np.arange(abs(left) / 0.75 + 3 * CELL_M, metres - 2 * CELL_M, CELL_M)
        assert set(states(known, pose, left, *before)) <= {FREE}
        behind = np.arange(metres + 2 * CELL_M, 7.0, CELL_M)
        assert set(states(known, pose, left, *behind)) == {UNKNOWN}
        across = np.linspace(left - 0.15, left + 0.15, 61)
        # Its middle may fall on either side of the line between two rows of cells.
        here = [known.state[known.cells(ahead_of(pose, across, np.full(61, metres + by)))] for by in (-0.03, 0, 0.03)]
        assert BLOCKED in np.concatenate(here)
    assert states(known, pose, 0.0, metres / 2) == [FREE]
    assert set(states(known, pose, 0.0, -0.2, -1.0, -3.0)) == {UNKNOWN}


@settings(deadline=None, max_examples=30)
@given(PLACES, HEADINGS, PLACES, HEADINGS)
def test_the_start_of_an_episode_is_all_the_same_to_the_map(
    start: tuple[float, float], heading: float, place: tuple[float, float], turned: float
) -> None:
    """From gps and compass, wherever in the world the episode began: metres forward and leftward of the start."""
    begin = np.array([[start[0], 0.0, start[1], heading]])
    now = np.concatenate([[0.0], [0.0], [0.0], [heading + turned]])[None].copy()
    now[0, [0, 2]] = ahead_of(begin[0], np.array(place[0]), np.array(place[1]))
    mine = map_pose(gps(now, begin)[0], float(compass(now, begin)[0, 0]))
    np.testing.assert_allclose(mine[[0, 2]], ahead_of(START, np.array(place[0]), np.array(place[1])), atol=1e-4)
    assert math.remainder(mine[3] - turned, 2 * math.pi) == pytest.approx(0, abs=1e-5)


def test_the_map_turns_with_the_agent() -> None:
    """Quarter turns on the spot see the same room, turned by as much."""
    maps = []
    for quarter in range(4):
        known = OccupancyMap(CONFIG)
        known.look(picture(2.03), np.array([CELL_M / 2, 0.0, CELL_M / 2, quarter * math.pi / 2]))
        rows, cols = known.cells(np.array([0.0, 0.0]))
        window = known.state[rows - 60 : rows + 61, cols - 60 : cols + 61]
        maps.append(np.rot90(window, -quarter))
    assert (maps[0] == BLOCKED).sum() > 20
    for turned in maps[1:]:
        assert (turned != maps[0]).mean() < 0.005  # cells that lie on an edge of the view


def test_floor_and_what_is_out_of_reach_block_nothing() -> None:
    known = OccupancyMap(CONFIG)
    known.look(empty_floor(), START)
    assert not (known.state == BLOCKED).any()
    assert states(known, START, 0.0, 4.9, 5.1) == [FREE, UNKNOWN]


def test_what_is_too_near_for_the_sensor_frees_nothing() -> None:
    known = OccupancyMap(CONFIG)
    known.look(picture(0.3), START)
    assert (known.state == UNKNOWN).all()


def test_a_wall_between_two_looks_is_not_seen_through() -> None:
    """What blocks once blocks for good; what is beyond may still be seen from the other side."""
    known = OccupancyMap(CONFIG)
    known.look(picture(2.0), START)
    wall = known.state == BLOCKED
    known.look(empty_floor(), START)
    assert (known.state[wall] == BLOCKED).all()


def test_a_bump_blocks_what_is_right_ahead_and_looking_does_not_clear_it() -> None:
    known = OccupancyMap(CONFIG)
    known.stand(START)
    assert states(known, START, 0.0, -0.1, 0.1) == [FREE, FREE]
    known.bump(START)
    known.look(empty_floor(), START)
    known.stand(START)
    assert states(known, START, 0.0, 0.21, 1.0) == [BLOCKED, FREE]
