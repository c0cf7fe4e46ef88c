"""How an agent moves on a navigation grid: compiled for many agents in many scenes at once.

Poses are (x, y, z, heading); turning left adds to the heading. Knows nothing of goals, rewards or episodes.
"""

import math

from numba import njit

from thinknav_sim.navigation.tables import cell_at

# The body is moved in pieces no longer than this, and so stops this close to what blocks it.
CONTACT_M = 0.01
# A wall runs as the cells within this many of the contact say: enough to smooth the stairs of a slanted one.
_WALL_CELLS = 4
# Who slides tries to go along the wall, then turned off it by once this angle, twice ... (radians).
_OFF_WALL_TURN = math.radians(15.0)
_OFF_WALL_TURNS = 7


@njit(cache=True)
def wrap(angle):  # type: ignore[no-untyped-def]
    """The same angle in (-pi, pi]; for a number or an array."""
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


@njit(cache=True)
def _can_stand(grids, scene, x, z):  # type: ignore[no-untyped-def]
    cell = cell_at(grids, scene, x, z)
    return cell >= 0 and grids.navigable[cell]


@njit(cache=True)
def _into_wall(grids, scene, x, z, dx, dz):  # type: ignore[no-untyped-def]
    """The direction (x, z), of length 1, into what blocks a step (dx, dz): there lies most of what blocks near it."""
    across, along, cell = 0.0, 0.0, grids.cell[scene]
    for row in range(-_WALL_CELLS, _WALL_CELLS + 1):
        for col in range(-_WALL_CELLS, _WALL_CELLS + 1):
            near = row * row + col * col <= _WALL_CELLS * _WALL_CELLS
            if near and not _can_stand(grids, scene, x + col * cell, z + row * cell):
                across += col
                along += row
    if across == 0 and along == 0:  # as much on either side, in a passage of one cell
        if _can_stand(grids, scene, x, z + dz):
            across = math.copysign(1.0, dx)
        else:
            along = math.copysign(1.0, dz)
    length = math.hypot(across, along)
    return across / length, along / length


@njit(cache=True)
def _slide(grids, scene, x, z, dx, dz):  # type: ignore[no-untyped-def]
    """Where a step (dx, dz) that is blocked leads along the wall: x, z, unchanged where there is no way.

    On a grid a slanted wall is a stair: round a corner of it one goes along the wall and off it, just enough.
    """
    wall_x, wall_z = _into_wall(grids, scene, x, z, dx, dz)
    along = dz * wall_x - dx * wall_z
    side, along = math.copysign(1.0, along), abs(along)
    for turn in range(_OFF_WALL_TURNS):
        angle = turn * _OFF_WALL_TURN
        cos, sin = math.cos(angle), math.sin(angle)
        step = min(along / cos, math.hypot(dx, dz))
        to_x = x + step * (-side * cos * wall_z - sin * wall_x)
        to_z = z + step * (side * cos * wall_x - sin * wall_z)
        if _can_stand(grids, scene, to_x, to_z):
            return to_x, to_z
    return x, z


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
        x, z = _slide(grids, scene, x, z, dx, dz)
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
        # Over steps the way counts as walking distances do, seen from above. In level homes the edge of a rug counts.
        climb = new_y - y if grids.level[scene] else 0.0
        path_lengths[agent] += math.sqrt((new_x - x) ** 2 + climb**2 + (new_z - z) ** 2)
        collisions[agent] += blocked
