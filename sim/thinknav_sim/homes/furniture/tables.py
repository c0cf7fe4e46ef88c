"""Tables and desks. Their tops are where `decor` puts things."""

import numpy as np

from thinknav_sim.homes.draw import chance
from thinknav_sim.homes.materials import DARK_METAL, GLASS, Style, pick_varied, shade, varied
from thinknav_sim.homes.mesh import Color, Mesh, box, cylinder, join, panel, revolve

DINING_HEIGHT_M = 0.75
COFFEE_HEIGHT_M = 0.42
DESK_DEPTH_M = 0.56


def _on_legs(width: float, depth: float, height: float, top: Color, leg: Color, thickness: float = 0.055) -> list[Mesh]:
    corners = [(x * (width / 2 - 0.06), z) for x in (-1, 1) for z in (0.06, depth - 0.06)]
    legs = [box((x, 0, z), (thickness, height - 0.04, thickness), leg) for x, z in corners]
    return [box((0, height - 0.04, depth / 2), (width, 0.04, depth), top), *legs]


def dining_table(rng: np.random.Generator, style: Style, width: float, depth: float) -> Mesh:
    """A rectangular table on four legs or on two trestles, with an apron under its top."""
    top = varied(rng, style.wood)
    if chance(rng, 0.7):
        parts = _on_legs(width, depth, DINING_HEIGHT_M, top, shade(top, 0.88))
        parts += [box((0, 0.63, z), (width - 0.18, 0.08, 0.025), shade(top, 0.85)) for z in (0.08, depth - 0.08)]
        return join(parts)
    sides = [
        box((x * (width / 2 - 0.2), 0, z), (0.06, 0.71, 0.08), DARK_METAL)
        for x in (-1, 1)
        for z in (0.12, depth - 0.12)
    ]
    sides += [box((x * (width / 2 - 0.2), 0, depth / 2), (0.06, 0.05, depth - 0.2), DARK_METAL) for x in (-1, 1)]
    return join([box((0, 0.71, depth / 2), (width, 0.04, depth), top), *sides])


def round_table(rng: np.random.Generator, style: Style, radius: float) -> Mesh:
    """A round table on one foot."""
    top = varied(rng, style.light_wood)
    foot = revolve((0, 0, radius), ((0.26, 0.0), (0.22, 0.03), (0.05, 0.08), (0.05, 0.71)), shade(top, 0.8), 8)
    return join([foot, revolve((0, 0.71, radius), ((0.0, 0.0), (radius, 0.0), (radius, 0.04), (0.0, 0.04)), top, 14)])


def coffee_table(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """A low table: wooden with a shelf, glass on metal, or round."""
    wood = pick_varied(rng, (style.wood, style.light_wood))
    if chance(rng, 0.25):
        disc = ((0.0, 0.0), (0.36, 0.0), (0.36, 0.035), (0.0, 0.035))
        legs = [box((x, 0, z), (0.04, 0.385, 0.04), shade(wood, 0.8)) for x in (-0.2, 0.2) for z in (0.16, 0.56)]
        return join([revolve((0, COFFEE_HEIGHT_M - 0.035, 0.36), disc, wood, 12), *legs])
    if chance(rng, 0.3):
        return join(_on_legs(width, 0.55, COFFEE_HEIGHT_M, GLASS, DARK_METAL, 0.035))
    shelf = box((0, 0.14, 0.275), (width - 0.12, 0.025, 0.43), shade(wood, 0.9))
    return join([*_on_legs(width, 0.55, COFFEE_HEIGHT_M, wood, shade(wood, 0.88)), shelf])


def side_table(rng: np.random.Generator, style: Style) -> Mesh:
    """A small round table for a lamp or a cup, 0.5 m high."""
    wood = varied(rng, style.light_wood)
    top = revolve((0, 0.47, 0.22), ((0.0, 0.0), (0.22, 0.0), (0.22, 0.03), (0.0, 0.03)), wood, 10)
    return join(
        [cylinder((0, 0, 0.22), 0.16, 0.02, style.metal), cylinder((0, 0.02, 0.22), 0.02, 0.45, style.metal, 6), top]
    )


def desk(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """A writing desk with a drawer block on one side."""
    top = varied(rng, style.light_wood)
    leg = style.metal if chance(rng, 0.5) else shade(top, 0.85)
    side = -1 if chance(rng, 0.5) else 1
    block = shade(top, 0.94)
    parts = _on_legs(width, DESK_DEPTH_M, DINING_HEIGHT_M, top, leg, 0.045)
    parts.append(box((side * (width / 2 - 0.25), 0.06, 0.28), (0.38, 0.62, 0.46), block))
    for y in (0.09, 0.29, 0.49):
        parts.append(panel((side * (width / 2 - 0.25), y, 0.515), (0.35, 0.17, 0.015), shade(block, 1.08)))
        parts.append(panel((side * (width / 2 - 0.25), y + 0.12, 0.527), (0.1, 0.015, 0.02), style.metal))
    return join(parts)
