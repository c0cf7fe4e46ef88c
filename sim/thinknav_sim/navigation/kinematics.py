"""How an agent moves on a navigation grid: compiled for many agents in many scenes at once.

Poses are (x, y, z, heading); turning left adds to the heading. Knows nothing of goals, rewards or episodes.
"""

import math

from numba import njit

from thinknav_sim.navigation.tables import cell_at

# The body is moved in pieces no longer than this, and so stops this close to what blocks it.
CONTACT_M = 0.01


@njit(cache=True)
def wrap(angle):  # type: ignore[no-untyped-def]
    """The same angle in (-pi, pi]; for a number or an array."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


@njit(cache=True)
def _can_stand(grids, scene, x, z):  # type: ignore[no-untyped-def]
    cell = cell_at(grids, scene, x, z)
    return cell >= 0 and grids.navigable[cell]


@njit(cache=True)
def walk(grids, scene, x, z, heading, length, sliding):  # type: ignore[no-untyped-def]
    """Walk straight on until blocked, or along what blocks when sliding. Returns x, z and whether anything blocked."""
    pieces = math.ceil(length / CONTACT_M - 1e-9)
    dx, dz = -math.sin(heading) * length / pieces, -math.cos(heading) * length / pieces
    blocked = False
    for _ in range(pieces):
        if _can_stand(grids, scene, x + dx, z + dz):
            x += dx
            z += dz
            continue
        blocked = True
        if not sliding:
            break
        if _can_stand(grids, scene, x + dx, z):
            x += dx
        elif _can_stand(grids, scene, x, z + dz):
            z += dz
        else:
            break
    return x, z, blocked


@njit(cache=True)
def advance(grids, scenes, poses, agents, turns, lengths, sliding, path_lengths, collisions):  # type: ignore[no-untyped-def]
    """Turn the named agents, or walk them forward, in place, and count how far they came and who was blocked.

    grids: GridTable. scenes: (N,) int64. poses: (N, 4) float64, changed. agents: (n,) int64, who acts. turns: (n,)
    radians. lengths: (n,) metres, 0 for who does not walk. sliding: bool. path_lengths: (N,) float64 and collisions:
    (N,) int64, added to.
    """
    for row in range(len(agents)):
        agent = agents[row]
        if turns[row] != 0:
            poses[agent, 3] = wrap(poses[agent, 3] + turns[row])
        if lengths[row] == 0:
            continue
        scene = scenes[agent]
        x, y, z = poses[agent, 0], poses[agent, 1], poses[agent, 2]
        new_x, new_z, blocked = walk(grids, scene, x, z, poses[agent, 3], lengths[row], sliding)
        # A start may come from elsewhere and stand a little off the grid: then it keeps its height.
        cell = cell_at(grids, scene, new_x, new_z)
        new_y = float(grids.floor[cell]) if cell >= 0 and grids.navigable[cell] else y
        poses[agent, 0], poses[agent, 1], poses[agent, 2] = new_x, new_y, new_z
        path_lengths[agent] += math.sqrt((new_x - x) ** 2 + (new_y - y) ** 2 + (new_z - z) ** 2)
        collisions[agent] += blocked
