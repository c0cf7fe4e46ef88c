"""The kernels of the map beside the same rules written plainly, ray by ray and heading by heading."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from thinknav_trainer.obstacle_kernels import BLOCKED, NOWHERE, fewest_turns, mark_obstacles
from thinknav_trainer.occupancy import ahead_of

CELL, HALF = 0.05, 4.0
SIDE = 160
STEP, RADIUS = 0.25, 0.17
SENSOR, BODY = (0.5, 5.0), (0.88, 1.4, 0.1)
OBSTACLES = st.sets(st.tuples(st.integers(-12, 12), st.integers(-12, 12)), max_size=25)  # in cells from the agent's
POSES = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-math.pi, math.pi))


def pose_of(place: tuple[float, float, float]) -> NDArray[np.float64]:
    """Somewhat beside the round numbers that hypothesis likes, for which rounding would decide."""
    return np.array([place[0] + 0.0123, 0.0, place[1] + 0.0071, place[2] + 0.0137])


@settings(deadline=None, max_examples=50)
@given(arrays(np.float32, (6, 5, 1), elements=st.sampled_from([0.0, 0.01, 0.1, 0.3, 0.7, 0.99, 1.0])), POSES)
def test_rays_block_the_cells_they_end_in(depth: NDArray[np.float32], place: tuple[float, float, float]) -> None:
    rows, columns = (axis.ravel() for axis in np.mgrid[0:6, 0:5])
    up, left = ((2.5 - rows) / 3).astype(np.float32), ((2.0 - columns) / 3).astype(np.float32)
    pose = pose_of(place)
    state = np.zeros((SIDE, SIDE), np.uint8)
    ahead = mark_obstacles(state, depth, (rows, columns, up, left), pose, SENSOR, BODY, CELL, HALF)

    forward = SENSOR[0] + (SENSOR[1] - SENSOR[0]) * depth.ravel()
    in_the_way = (forward < SENSOR[1]) & (np.abs(0.88 + up * forward - 0.75) < 0.65)
    np.testing.assert_allclose(
        ahead, np.where(in_the_way, np.where(depth.ravel() > 0, forward, 0), SENSOR[1]), rtol=1e-6
    )
    ends = [
        ahead_of(pose, np.array(left[ray] * metres), np.array(metres))
        for ray, share in enumerate(depth.ravel())
        if 0 < share < 1 and 0.1 < 0.88 + up[ray] * (metres := 0.5 + 4.5 * share) < 1.4
    ]
    blocked = (np.argwhere(state == BLOCKED)[:, ::-1] + 0.5) * CELL - HALF
    # Of the ends that lie on the map, each is in a blocked cell, and each blocked cell has one; but for rounding.
    for end in ends:
        assert np.abs(np.clip(end, -HALF, HALF) - blocked).max(axis=1).min() <= CELL / 2 + 1e-5
    for cell in blocked:
        assert np.abs(np.clip(ends, -HALF, HALF) - cell).max(axis=1).min() <= CELL / 2 + 1e-5


@settings(deadline=None, max_examples=100)
@given(OBSTACLES, POSES, st.sampled_from([10, 15, 30]))
def test_the_nearest_heading_whose_step_meets_nothing(
    obstacles: set[tuple[int, int]], place: tuple[float, float, float], degrees: int
) -> None:
    pose, turn = pose_of(place), math.radians(degrees)
    state = np.zeros((SIDE, SIDE), np.uint8)
    row, column = (math.floor((metres + HALF) / CELL) for metres in (pose[2], pose[0]))
    for i, j in obstacles:
        state[row + i, column + j] = BLOCKED
    middles = [
        np.array([(column + j + 0.5) * CELL - HALF - pose[0], (row + i + 0.5) * CELL - HALF - pose[2]])
        for i, j in obstacles
    ]

    def is_free(turns: int) -> bool:
        """No middle of a cell comes nearer than the radius on the step, but those that are beside or behind."""
        heading = pose[3] + turns * turn
        ahead = np.array([-math.sin(heading), -math.cos(heading)])
        on_the_way = [ahead * share for share in np.linspace(0, STEP, 501)]
        return all(
            middle @ ahead <= 0 or min(float(np.linalg.norm(middle - point)) for point in on_the_way) >= RADIUS
            for middle in middles
        )

    most = 180 // degrees
    order = sorted(range(-most + (180 % degrees == 0), most + 1), key=lambda turns: (abs(turns), -turns))
    expected = next((turns for turns in order if is_free(turns)), NOWHERE)
    assert fewest_turns(state, pose, turn, STEP, RADIUS, CELL, HALF) == expected
