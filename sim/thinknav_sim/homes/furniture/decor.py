"""Lamps, pictures, rugs, and the small things that lie about."""

import numpy as np

from thinknav_sim.homes.draw import between, chance, pick
from thinknav_sim.homes.materials import (
    BLACK,
    BOOKS,
    LAMP_GLOW,
    SKY_LOW,
    STEEL,
    WHITE,
    Style,
    mix,
    pick_varied,
    shade,
    varied,
)
from thinknav_sim.homes.mesh import Color, Mesh, box, cylinder, ellipsoid, grid, join, panel, quads, revolve, rod

_SHADE = ((0.17, 0.0), (0.12, 0.22))


def floor_lamp(rng: np.random.Generator, style: Style) -> Mesh:
    """A standing lamp with a cloth shade, or one on three legs."""
    height, z = between(rng, 1.4, 1.6), 0.2
    glow = mix(LAMP_GLOW, pick(rng, style.accents), 0.15)
    if chance(rng, 0.5):
        stand = [
            cylinder((0, 0, z), 0.14, 0.025, style.metal, 8),
            cylinder((0, 0.02, z), 0.014, height, style.metal, 5),
        ]
    else:
        feet = ((-0.17, 0.05), (0.17, 0.05), (0.0, 0.37))
        stand = [rod((x, 0.0, foot), (0, height - 0.05, z), 0.026, style.light_wood) for x, foot in feet]
    return join([*stand, revolve((0, height - 0.06, z), _SHADE, glow, 9)])


def table_lamp(rng: np.random.Generator, style: Style) -> Mesh:
    """A lamp of 0.4 m for a nightstand or a desk."""
    foot = pick_varied(rng, (style.pot, style.accents[0], STEEL))
    base = revolve((0, 0, 0.1), ((0.06, 0.0), (0.075, 0.09), (0.02, 0.22)), foot, 6)
    return join([base, revolve((0, 0.21, 0.1), ((0.1, 0.0), (0.065, 0.15)), LAMP_GLOW, 7)])


def ceiling_lamp(rng: np.random.Generator, style: Style, ceiling: float) -> Mesh:
    """A pendant, or a flat bowl under the ceiling; x = z = 0 is its middle."""
    if chance(rng, 0.5):
        rope = box((0, ceiling - 0.35, 0), (0.015, 0.35, 0.015), BLACK)
        cone = revolve((0, ceiling - 0.55, 0), ((0.2, 0.0), (0.1, 0.18), (0.02, 0.2)), pick(rng, style.accents), 8)
        bulb = revolve((0, ceiling - 0.55, 0), ((0.0, -0.01), (0.16, 0.01)), LAMP_GLOW, 6)
        return join([rope, cone, bulb])
    return revolve((0, ceiling - 0.1, 0), ((0.0, 0.0), (0.15, 0.02), (0.2, 0.08), (0.2, 0.1)), LAMP_GLOW, 9)


def picture(rng: np.random.Generator, style: Style, width: float, height: float) -> Mesh:
    """A framed picture at eye level: a landscape, stripes, or coloured fields."""
    low = 1.55 - height / 2
    frame = pick(rng, (BLACK, style.wood, WHITE))
    parts = [panel((0, low, 0.014), (width, height, 0.028), frame)]
    half, rise = width / 2 - 0.035, height - 0.07
    colors = [varied(rng, color, 0.1) for color in style.accents]
    kind = pick(rng, ("landscape", "stripes", "fields"))
    if kind == "landscape":
        cells = grid((-half, half), (0.0, rise * 0.3, rise * 0.55, rise))
        shades: list[Color] = [shade(colors[5], 0.8), mix(colors[2], WHITE, 0.3), SKY_LOW]
    elif kind == "stripes":
        cells = grid(np.linspace(-half, half, 6), (0.0, rise))
        shades = [colors[index] for index in range(5)]
    else:
        split = between(rng, -0.1, 0.1) * width
        cells = grid((-half, split, half), (0.0, rise * between(rng, 0.3, 0.7), rise))
        shades = colors[:4]
    flat = np.concatenate((cells, np.full((len(cells), 4, 1), 0.03)), axis=-1) + np.array((0.0, low + 0.035, 0.0))
    return join([*parts, quads(flat, np.array(shades))])


def rug(rng: np.random.Generator, style: Style, width: float, depth: float) -> Mesh:
    """A rug about x = z = 0: a border and a plain, striped or chequered field."""
    first, second = (mix(color, (0.7, 0.68, 0.64), 0.35) for color in (style.accents[3], style.accents[4]))
    columns, rows = max(3, round(width / 0.3)), max(3, round(depth / 0.3))
    cells = grid(np.linspace(-width / 2, width / 2, columns + 1), np.linspace(-depth / 2, depth / 2, rows + 1))
    index = np.arange(len(cells))
    column, row = index % columns, index // columns
    border = (column == 0) | (column == columns - 1) | (row == 0) | (row == rows - 1)
    pattern = pick(rng, (np.zeros(len(cells), dtype=bool), column % 2 == 1, (column + row) % 2 == 1))
    field = np.where(pattern[:, None], np.array(mix(first, second, 0.5)), np.array(first))
    shades = np.where(border[:, None], np.array(second), field)
    height = np.full((len(cells), 4, 1), 0.012)
    points = np.concatenate((cells[..., :1], height, cells[..., 1:]), axis=-1)
    return join([box((0, 0, 0), (width, 0.011, depth), shade(second, 0.8)), quads(points, shades, toward=(0, 5, 0))])


def tabletop_things(rng: np.random.Generator, style: Style) -> list[Mesh]:
    """One to three small things within 0.15 m of the origin: a bowl of fruit, books, cups, a vase."""
    kind = pick(rng, ("fruit", "books", "cups", "vase"))
    if kind == "fruit":
        bowl = revolve((0, 0, 0), ((0.06, 0.0), (0.14, 0.08), (0.0, 0.05)), pick(rng, style.accents), 8)
        fruit = [
            ellipsoid(
                (x, 0.09, z),
                (0.04, 0.04, 0.04),
                pick_varied(rng, ((0.8, 0.3, 0.2), (0.85, 0.6, 0.2), (0.5, 0.65, 0.25))),
                5,
            )
            for x, z in ((-0.05, 0.0), (0.05, 0.02), (0.0, -0.05))
        ]
        return [bowl, *fruit]
    if kind == "books":
        sizes = ((0.24, 0.17), (0.21, 0.15), (0.17, 0.13))
        return [box((0, 0.03 * i, 0), (w, 0.028, d), pick_varied(rng, BOOKS)) for i, (w, d) in enumerate(sizes)]
    if kind == "cups":
        return [
            cylinder((x, 0, z), 0.04, 0.09, pick_varied(rng, (WHITE, *style.accents)), 7)
            for x, z in ((-0.08, 0.03), (0.08, -0.04))
        ]
    body = ((0.04, 0.0), (0.07, 0.1), (0.03, 0.2), (0.04, 0.23))
    return [revolve((0, 0, 0), body, pick_varied(rng, style.accents), 8)]


def floor_things(rng: np.random.Generator, style: Style) -> Mesh:
    """A basket, a stack of boxes or a bin, back at z = 0."""
    kind = pick(rng, ("basket", "boxes", "bin"))
    if kind == "basket":
        straw = (0.72, 0.58, 0.38)
        rim = revolve((0, 0, 0.19), ((0.15, 0.0), (0.19, 0.32), (0.16, 0.32), (0.15, 0.2)), varied(rng, straw), 9)
        return join([rim, ellipsoid((0, 0.22, 0.19), (0.15, 0.1, 0.15), pick(rng, style.accents), 6)])
    if kind == "boxes":
        card = (0.68, 0.54, 0.38)
        return join(
            [
                box((0, 0, 0.17), (0.42, 0.28, 0.34), card),
                box((0, 0.28, 0.17), (0.06, 0.002, 0.34), shade(card, 1.2)),
                box((0.03, 0.282, 0.16), (0.3, 0.2, 0.26), pick_varied(rng, (card, *style.accents))),
            ]
        )
    tube = ((0.1, 0.0), (0.13, 0.32), (0.11, 0.32), (0.1, 0.1), (0.0, 0.1))
    return revolve((0, 0, 0.14), tube, pick_varied(rng, (style.metal, WHITE, *style.accents)), 8)


def wall_shelf(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """A board on the wall at 1.45 m with a few books."""
    parts = [box((0, 1.45, 0.11), (width, 0.03, 0.22), style.wood)]
    x = -width / 2 + 0.05
    while x < width / 2 - 0.15:
        for _ in range(2 + int(rng.integers(3))):
            thick, high = between(rng, 0.03, 0.06), between(rng, 0.16, 0.26)
            parts.append(panel((x + thick / 2, 1.48, 0.1), (thick - 0.003, high, 0.16), pick_varied(rng, BOOKS)))
            x += thick
        x += between(rng, 0.12, 0.25)
    return join(parts)
