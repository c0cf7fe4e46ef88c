"""Beds, headboard at the back, and what stands beside them."""

import numpy as np

from thinknav_sim.homes.draw import between, chance, pick
from thinknav_sim.homes.materials import WHITE, Style, pick_varied, shade, varied
from thinknav_sim.homes.mesh import Color, Mesh, box, cushion, join, panel


def bed(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """A made bed: frame, mattress, blanket with a fold, pillows, and one of three headboards."""
    frame = pick_varied(rng, (style.wood, style.wood, style.light_wood, WHITE))
    cover, throw = varied(rng, style.bedding[0]), varied(rng, style.bedding[1])
    length = 2.06
    parts = _headboard(rng, style, width, frame)
    parts += [box((0, 0.10, 0.06 + length / 2), (width, 0.22, length), frame)]
    parts += [
        box((x * (width / 2 - 0.05), 0, z), (0.07, 0.10, 0.07), shade(frame, 0.8))
        for x in (-1, 1)
        for z in (0.1, length)
    ]
    parts += [cushion((0, 0.32, 0.06 + length / 2), (width - 0.06, 0.20, length - 0.06), WHITE, 0.05)]
    top = 0.52
    fold = between(rng, 0.62, 0.78)
    blanket = length - fold
    parts += [cushion((0, 0.24, fold + blanket / 2 + 0.07), (width + 0.02, top - 0.21, blanket), cover, 0.05)]
    parts += [cushion((0, top - 0.02, fold + 0.10), (width + 0.02, 0.07, 0.24), shade(WHITE, 0.97), 0.02)]
    if chance(rng, 0.8):
        parts += [cushion((0, 0.25, length - 0.35), (width + 0.04, top - 0.20, 0.5), throw, 0.05)]
    parts += _pillows(rng, style, width, top)
    return join(parts)


def _headboard(rng: np.random.Generator, style: Style, width: float, frame: Color) -> list[Mesh]:
    height = between(rng, 0.88, 1.12)
    kind = pick(rng, ("board", "padded", "slats"))
    if kind == "board":
        return [box((0, 0, 0.03), (width + 0.06, height, 0.06), frame)]
    if kind == "padded":
        cloth = pick_varied(rng, (style.sofa, style.seat))
        count = 3 if width > 1.2 else 2
        panel = (width + 0.06) / count
        left = -(width + 0.06) / 2
        return [
            cushion((left + (i + 0.5) * panel, 0.1, 0.04), (panel - 0.01, height - 0.1, 0.08), cloth, 0.03)
            for i in range(count)
        ]
    posts = [box((x * width / 2, 0, 0.03), (0.06, height, 0.06), frame) for x in (-1, 1)]
    rails = [box((0, y, 0.03), (width, 0.07, 0.035), frame) for y in (0.5, height - 0.09)]
    count = int(width / 0.16)
    bars = [
        box(((i + 1) * width / (count + 1) - width / 2, 0.55, 0.03), (0.035, height - 0.62, 0.025), frame)
        for i in range(count)
    ]
    return posts + rails + bars


def _pillows(rng: np.random.Generator, style: Style, width: float, top: float) -> list[Mesh]:
    sides = (-1, 1) if width > 1.2 else (0,)
    color = varied(rng, WHITE, 0.03)
    pillow = min(0.66, width / len(sides) - 0.12)
    parts = [cushion((x * width / 4, top - 0.01, 0.32), (pillow, 0.13, 0.42), color, 0.06) for x in sides]
    if chance(rng, 0.6):
        parts += [
            cushion((x * width / 4, top - 0.01, 0.57), (0.4, 0.24, 0.13), pick_varied(rng, style.accents), 0.05)
            for x in sides
        ]
    return parts


def nightstand(rng: np.random.Generator, style: Style) -> Mesh:
    """A low cabinet with two drawers."""
    wood, height = varied(rng, style.wood), between(rng, 0.46, 0.56)
    front = shade(wood, 1.12)
    drawers = [panel((0, y, 0.385), (0.38, height / 2 - 0.07, 0.02), front) for y in (0.08, height / 2 + 0.03)]
    knobs = [panel((0, y + height / 4 - 0.05, 0.4), (0.08, 0.02, 0.02), style.metal) for y in (0.08, height / 2 + 0.03)]
    return join([box((0, 0.04, 0.19), (0.44, height - 0.04, 0.37), wood), *drawers, *knobs])
