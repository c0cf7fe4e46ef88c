"""Plants in pots: broad leaves, upright blades, small trees, and small ones for tables."""

import math

import numpy as np

from thinknav_sim.homes.draw import between, pick
from thinknav_sim.homes.materials import GREENS, POTS, SOIL, Style, pick_varied, shade, varied
from thinknav_sim.homes.mesh import Color, Mesh, ellipsoid, join, leaf, revolve, rod


def _pot(rng: np.random.Generator, style: Style, radius: float, height: float) -> list[Mesh]:
    """A pot whose middle is at z = radius, so that its back is at z = 0."""
    color = pick_varied(rng, (style.pot, *POTS))
    shape = pick(rng, (0.72, 0.85, 1.0))
    profile = ((radius * shape, 0.0), (radius, height), (radius * 0.86, height), (radius * 0.86, height - 0.03))
    soil = revolve((0, height - 0.03, radius), ((radius * 0.86, 0.0), (0.0, 0.005)), SOIL, 7)
    return [revolve((0, 0, radius), profile, color, 7), soil]


def _crown(
    rng: np.random.Generator, root: tuple[float, float, float], count: int, reach: float, rise: float, green: Color
) -> list[Mesh]:
    """Leaves from one point outwards, in turns of the golden angle."""
    leaves = []
    x, y, z = root
    for index in range(count):
        turn = 2.4 * index + 0.3 * float(rng.random())
        out = reach * (0.55 + 0.45 * float(rng.random()))
        up = rise * (1.0 - 0.75 * index / count)
        tip = (x + out * math.sin(turn), y + up, z + out * math.cos(turn))
        leaves.append(leaf(root, tip, out * 0.55, varied(rng, green, 0.14)))
    return leaves


def floor_plant(rng: np.random.Generator, style: Style) -> Mesh:
    """A plant of 0.8 to 1.6 m that stands on the floor, within 0.5 m square."""
    return pick(rng, (_broad_leaved, _bladed, _tree))(rng, style)


def _broad_leaved(rng: np.random.Generator, style: Style) -> Mesh:
    radius, height = 0.16, between(rng, 0.26, 0.36)
    green = pick_varied(rng, GREENS)
    parts = _pot(rng, style, radius, height)
    for tier, reach in ((0.0, 0.30), (0.25, 0.28), (0.5, 0.22)):
        root = (0.0, height + tier * 0.8, radius)
        parts += _crown(rng, root, 7, reach, between(rng, 0.32, 0.48), green)
    parts.append(rod((0, height, radius), (0, height + 0.45, radius), 0.025, shade(green, 0.7)))
    return _backed(join(parts))


def _bladed(rng: np.random.Generator, style: Style) -> Mesh:
    radius, height = 0.17, between(rng, 0.3, 0.42)
    green = pick_varied(rng, GREENS)
    blades = []
    for index in range(14):
        turn, out = 2.4 * index, 0.05 + 0.11 * float(rng.random())
        start = (0.5 * out * math.sin(turn), height - 0.02, radius + 0.5 * out * math.cos(turn))
        tip = (out * 1.3 * math.sin(turn), height + between(rng, 0.4, 0.75), radius + out * 1.3 * math.cos(turn))
        blades.append(leaf(start, tip, 0.075, varied(rng, green, 0.15)))
    return _backed(join([*_pot(rng, style, radius, height), *blades]))


def _tree(rng: np.random.Generator, style: Style) -> Mesh:
    radius, height, top = 0.18, between(rng, 0.3, 0.4), between(rng, 0.95, 1.2)
    green = pick_varied(rng, GREENS)
    parts = [
        *_pot(rng, style, radius, height),
        rod((0, height - 0.03, radius), (0.02, top, radius), 0.045, (0.42, 0.30, 0.20)),
    ]
    clumps = ((0.0, 0.12, 0.0, 0.20), (-0.11, -0.02, 0.06, 0.15), (0.11, 0.04, -0.04, 0.16))
    for x, y, z, size in clumps:
        parts.append(ellipsoid((x, top + y, radius + z), (size, size * 0.9, size), varied(rng, green, 0.12), 6))
    parts += _crown(rng, (0.0, top + 0.1, radius), 9, 0.28, 0.3, green)
    return _backed(join(parts))


def table_plant(rng: np.random.Generator, style: Style) -> Mesh:
    """A plant of 0.35 m that stands on furniture."""
    parts = _pot(rng, style, 0.08, 0.13)
    parts += _crown(rng, (0.0, 0.12, 0.08), 11, 0.19, 0.26, pick_varied(rng, GREENS))
    return _backed(join(parts))


def _backed(mesh: Mesh) -> Mesh:
    """Moved so that no leaf reaches behind z = 0."""
    return mesh.moved(z=-float(mesh.low[2]))
