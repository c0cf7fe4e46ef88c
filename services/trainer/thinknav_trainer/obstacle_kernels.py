"""The inner loops of an agent's map: what its depth sensor saw in the way, and which heading is free.

They run at every step of every agent, over thousands of rays and cells. Know arrays only; see `occupancy`.
"""

import math

import numpy as np
from numba import njit

UNKNOWN, FREE, BLOCKED = 0, 1, 2  # states of a cell
NOWHERE = 1_000_000  # turns


@njit(cache=True)
def mark_obstacles(state, depth, rays, pose, sensor, body, cell, half):  # type: ignore[no-untyped-def]
    """Block the cells in which rays end on what stands in the way of a body.

    state: (rows, cols) uint8, changed. depth: (H, W, 1) float32, as shares of the sensor's reach. rays: row and column
    of each one's pixel, metres up and to the left of the camera at depth 1, all (R,). pose: (4,), in the map's frame.
    sensor: metres at depths 0 and 1. body: height of its camera, its own, and what it steps over.
    cell: metres. half: how far the map reaches.

    Returns how many metres ahead each ray (R,) meets what is in the way: 0 where it is too near to be read, the
    sensor's reach where nothing is.
    """
    rows, columns, up, left = rays
    ahead = np.full(len(rows), sensor[1], np.float32)
    nearest, reach = np.float32(sensor[0]), np.float32(sensor[1] - sensor[0])
    eye, top, floor = np.float32(body[0]), np.float32(body[1]), np.float32(body[2])
    sine, cosine = np.float32(math.sin(pose[3])), np.float32(math.cos(pose[3]))
    for ray in range(len(rows)):
        seen = depth[rows[ray], columns[ray], 0]
        if not seen < 1:  # too far
            continue
        forward = nearest + seen * reach
        height = eye + up[ray] * forward
        if not floor < height < top:
            continue
        if not seen > 0:  # somewhere in front of the body
            ahead[ray] = 0
            continue
        ahead[ray] = forward
        aside = left[ray] * forward
        x = pose[0] - cosine * aside - sine * forward
        z = pose[2] + sine * aside - cosine * forward
        state[_cell(z, cell, half, state.shape[0]), _cell(x, cell, half, state.shape[1])] = BLOCKED
    return ahead


@njit(cache=True)
def fewest_turns(state, pose, turn, step, radius, cell, half):  # type: ignore[no-untyped-def]
    """How many turns, positive to the left, to a heading that is free for a step; NOWHERE if none is.

    state: (rows, cols) uint8. pose: (4,). turn: radians. step, radius of the body, cell: metres.
    half: how far the map reaches. Of two headings as near, the one to the left.
    """
    blocked = _blocked_near(state, pose, step + radius + 2 * cell, cell, half)
    most = math.floor(math.pi / turn + 1e-9)
    for k in range(2 * most + 1):
        turns = (k + 1) // 2 if k % 2 else -(k // 2)  # 0, 1, -1, 2, ...
        if not _meets(blocked, pose[3] + turns * turn, step, radius):
            return turns
    return NOWHERE


@njit(cache=True)
def _blocked_near(state, pose, reach, cell, half):  # type: ignore[no-untyped-def]
    """(n, 2): x and z, from the pose, of the middles of blocked cells within so many metres of it."""
    found = []
    column, row = math.floor(pose[0] / cell), math.floor(pose[2] / cell)
    cells = math.ceil(reach / cell) + 1
    for i in range(row - cells, row + cells + 1):
        for j in range(column - cells, column + cells + 1):
            x, z = (j + 0.5) * cell, (i + 0.5) * cell
            if math.sqrt((x - pose[0]) ** 2 + (z - pose[2]) ** 2) > reach:
                continue
            at = _cell(z, cell, half, state.shape[0]), _cell(x, cell, half, state.shape[1])
            if state[at] == BLOCKED:
                found.append(((at[1] + 0.5) * cell - half - pose[0], (at[0] + 0.5) * cell - half - pose[2]))
    return found


@njit(cache=True)
def _meets(blocked, heading, step, radius):  # type: ignore[no-untyped-def]
    """Whether a body that takes a step would meet one of the cells that it does not touch already.

    It sweeps a capsule as long as a step, its own half left out.
    """
    sine, cosine = math.sin(heading), math.cos(heading)
    for x, z in blocked:
        forward = -sine * x - cosine * z
        if forward > 0 and math.hypot(forward - min(forward, step), -cosine * x + sine * z) < radius:
            return True
    return False


@njit(cache=True)
def _cell(metres, cell, half, count):  # type: ignore[no-untyped-def]
    """The row or column of a place; the rim for what lies beyond."""
    return min(max(math.floor((metres + half) / cell), 0), count - 1)
