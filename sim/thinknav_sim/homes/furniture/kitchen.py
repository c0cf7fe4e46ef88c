"""Kitchen runs (base and wall cabinets with a worktop), sinks, stoves, fridges."""

import numpy as np

from thinknav_sim.homes.draw import between, chance
from thinknav_sim.homes.materials import BLACK, DARK_METAL, STEEL, WHITE, Style, pick_varied, shade
from thinknav_sim.homes.mesh import Mesh, box, join, panel, quads, revolve

UNIT_M = 0.6
COUNTER_HEIGHT_M = 0.9
_DEPTH_M = 0.6
_BLUE_WHITE = (0.88, 0.91, 0.94)


def counter(style: Style, units: int) -> Mesh:
    """Base cabinets of `units` x 0.6 m under one worktop, with a splashback of tiles."""
    width = units * UNIT_M
    parts = [
        box((0, 0, _DEPTH_M / 2 - 0.03), (width, 0.1, _DEPTH_M - 0.08), shade(style.cabinet, 0.5)),
        box(
            (0, 0.1, (_DEPTH_M - 0.03) / 2),
            (width, COUNTER_HEIGHT_M - 0.14, _DEPTH_M - 0.03),
            shade(style.cabinet, 0.9),
        ),
        box((0, COUNTER_HEIGHT_M - 0.04, _DEPTH_M / 2), (width, 0.04, _DEPTH_M), style.countertop),
        box((0, COUNTER_HEIGHT_M, 0.006), (width, 0.12, 0.012), style.countertop),
    ]
    for unit in range(units):
        x = _unit_x(units, unit)
        parts.append(panel((x, 0.12, _DEPTH_M - 0.02), (UNIT_M - 0.015, 0.55, 0.02), style.cabinet))
        parts.append(panel((x, 0.69, _DEPTH_M - 0.02), (UNIT_M - 0.015, 0.15, 0.02), style.cabinet))
        parts.append(panel((x, 0.6, _DEPTH_M), (0.16, 0.018, 0.022), style.metal))
        parts.append(panel((x, 0.78, _DEPTH_M), (0.16, 0.018, 0.022), style.metal))
    return join(parts)


def _unit_x(units: int, unit: int) -> float:
    return (unit + 0.5 - units / 2) * UNIT_M


def wall_cabinets(style: Style, units: int) -> Mesh:
    """Cabinets on the wall over a counter."""
    body, front = shade(style.cabinet, 0.92), shade(style.cabinet, 1.02)
    parts = [box((0, 1.45, 0.16), (units * UNIT_M, 0.68, 0.32), body)]
    for unit in range(units):
        x = _unit_x(units, unit)
        parts.append(panel((x, 1.465, 0.33), (UNIT_M - 0.015, 0.65, 0.018), front))
        parts.append(panel((x + 0.22, 1.5, 0.345), (0.018, 0.14, 0.018), style.metal))
    return join(parts)


def sink(style: Style) -> Mesh:
    """A steel basin let into the worktop, and its tap."""
    y = COUNTER_HEIGHT_M
    edge = [(-0.24, y + 0.004, 0.13), (0.24, y + 0.004, 0.13), (0.24, y + 0.004, 0.5), (-0.24, y + 0.004, 0.5)]
    bowl = [(-0.2, y + 0.007, 0.17), (0.2, y + 0.007, 0.17), (0.2, y + 0.007, 0.46), (-0.2, y + 0.007, 0.46)]
    depths = [[shade(STEEL, 0.45), shade(STEEL, 0.5), shade(STEEL, 0.75), shade(STEEL, 0.7)]]
    return join(
        [
            quads([edge], STEEL, toward=(0, 5, 0)),
            quads([bowl], depths, toward=(0, 5, 0)),
            box((0, y, 0.08), (0.035, 0.28, 0.035), style.metal),
            box((0, y + 0.26, 0.17), (0.03, 0.03, 0.2), style.metal),
        ]
    )


def stove() -> Mesh:
    """A hob with four rings on the worktop, and an oven's front below it."""
    y = COUNTER_HEIGHT_M
    hob = box((0, y, 0.31), (0.56, 0.008, 0.5), BLACK)
    rings = [
        revolve((x, y + 0.012, z), ((0.085, 0.0), (0.0, 0.0)), (0.32, 0.28, 0.28), 8)
        for x in (-0.14, 0.14)
        for z in (0.19, 0.43)
    ]
    oven = box((0, 0.14, 0.6), (0.58, 0.68, 0.025), DARK_METAL)
    window = box((0, 0.24, 0.614), (0.42, 0.32, 0.006), BLACK)
    handle = box((0, 0.64, 0.635), (0.46, 0.025, 0.03), STEEL)
    knobs = [box((x, 0.74, 0.622), (0.035, 0.035, 0.03), STEEL) for x in (-0.2, -0.07, 0.07, 0.2)]
    return join([hob, *rings, oven, window, handle, *knobs])


def fridge(rng: np.random.Generator, style: Style) -> Mesh:
    """A tall fridge with a freezer door."""
    body = pick_varied(rng, (WHITE, STEEL, _BLUE_WHITE, style.accents[0] if chance(rng, 0.3) else STEEL))
    height, split = between(rng, 1.7, 1.9), between(rng, 0.55, 0.7)
    parts = [
        box((0, 0.03, 0.3), (0.64, height - 0.03, 0.58), shade(body, 0.9)),
        box((0, 0.05, 0.61), (0.63, split - 0.06, 0.04), body),
        box((0, split + 0.01, 0.61), (0.63, height - split - 0.02, 0.04), body),
        box((0.24, split - 0.26, 0.645), (0.025, 0.2, 0.03), STEEL),
        box((0.24, split + 0.08, 0.645), (0.025, 0.42, 0.03), STEEL),
    ]
    if chance(rng, 0.5):
        parts += [
            box((x, y, 0.634), (0.07, 0.09, 0.008), color)
            for x, y, color in ((-0.15, 1.3, style.accents[1]), (0.02, 1.38, style.accents[2]), (-0.08, 1.15, WHITE))
        ]
    return join(parts)
