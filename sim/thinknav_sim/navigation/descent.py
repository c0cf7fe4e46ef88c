"""The way an agent that knows the map would go: greedy descent of the distance to the goal.

Of the headings that turning can give, the one whose next forward step ends nearest to the goal. The choice is the same
while the agent turns towards it, so it never dithers. Knows nothing of when to stop; `thinknav_sim.success` does.
"""

import math

import numpy as np
from numba import njit

from thinknav_sim.navigation.geodesic import bilinear
from thinknav_sim.navigation.kinematics import walk

# What a turn may cost in metres: of headings that lead equally well, the one that needs fewer turns.
_TURN_COST_M = 0.002


@njit(cache=True)
def turns_towards_goal(grids, scene, field, pose, length, turn, sliding):  # type: ignore[no-untyped-def]
    """How many turns, positive to the left, before walking forward brings an agent nearest to the goal.

    grids: GridTable. scene: index in it. field: (rows, cols) walking distances. pose: (4,). length: of a step, metres.
    turn: of a turn, radians.
    """
    half = math.floor(math.pi / turn + 1e-9)
    best, least = 0, np.inf
    origin, cell = grids.origin[scene], grids.cell[scene]
    for k in range(2 * half + 1):
        # 0, 1, -1, 2, -2, ...: ties go to the left.
        turns = (k + 1) // 2 if k % 2 else -(k // 2)
        x, z, _ = walk(grids, scene, pose[0], pose[2], pose[3] + turns * turn, length, sliding)
        cost = bilinear(field, origin[0], origin[1], cell, x, z) + _TURN_COST_M * abs(turns)
        if cost < least - 1e-9:
            best, least = turns, cost
    return best
