"""Toilets, washbasins, bathtubs, showers."""

import numpy as np

from thinknav_sim.homes.draw import between, chance
from thinknav_sim.homes.materials import CERAMIC, MIRROR, STEEL, WHITE, Style, pick_varied, shade, varied
from thinknav_sim.homes.mesh import Mesh, box, cushion, cylinder, join, quads, revolve, rod

_WATER = (0.62, 0.78, 0.84)


def toilet(rng: np.random.Generator, style: Style) -> Mesh:
    """Bowl, seat with its lid up or down, and a tank; or a bowl hung on a boxed-in cistern."""
    hung = chance(rng, 0.3)
    bowl_z = 0.44
    foot = ((0.0, 0.12), (0.12, 0.14), (0.18, 0.26)) if hung else ((0.0, 0.0), (0.13, 0.0), (0.12, 0.12), (0.19, 0.30))
    rim = (*foot, (0.2, 0.36))
    bowl = revolve((0, 0.03, bowl_z), rim, CERAMIC, 10, (0.95, 1.2))
    parts = [bowl, box((0, 0.14, 0.24), (0.24, 0.22, 0.22), CERAMIC)]
    opened = chance(rng, 0.5)
    seat = ((0.2, 0.0), (0.2, 0.03), (0.13, 0.03), (0.12, 0.0)) if opened else ((0.2, 0.0), (0.2, 0.045), (0.0, 0.05))
    parts.append(revolve((0, 0.39, bowl_z), seat, shade(WHITE, 0.98), 10, (0.98, 1.22)))
    if opened:
        parts.append(cylinder((0, 0.36, bowl_z), 0.16, 0.01, _WATER, 8))
        parts.append(cushion((0, 0.41, 0.21), (0.37, 0.40, 0.035), WHITE, 0.015))
    if hung:
        parts.append(box((0, 0, 0.08), (0.6, 1.1, 0.16), varied(rng, style.tiles[0], 0.03)))
        parts.append(box((0, 0.9, 0.163), (0.22, 0.14, 0.012), STEEL))
    else:
        parts.append(cushion((0, 0.36, 0.1), (0.40, 0.40, 0.18), CERAMIC, 0.02))
        parts.append(box((0, 0.76, 0.1), (0.42, 0.035, 0.2), shade(CERAMIC, 0.97)))
        parts.append(cylinder((0, 0.79, 0.1), 0.03, 0.015, STEEL, 8))
    return join(parts)


def washstand(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """A vanity cabinet with a basin and a tap."""
    body = pick_varied(rng, (style.cabinet, style.wood, WHITE))
    parts = [
        box((0, 0.22, 0.22), (width, 0.53, 0.43), body),
        *(box((x * width / 4, 0.25, 0.44), (width / 2 - 0.02, 0.46, 0.02), shade(body, 1.07)) for x in (-1, 1)),
        *(box((x * 0.05, 0.5, 0.46), (0.02, 0.14, 0.02), STEEL) for x in (-1, 1)),
        box((0, 0.75, 0.235), (width + 0.02, 0.04, 0.47), shade(style.countertop, 1.05)),
        revolve((0, 0.79, 0.26), ((0.13, 0.0), (0.19, 0.11), (0.17, 0.11), (0.11, 0.03), (0.0, 0.03)), CERAMIC, 8),
        box((0, 0.79, 0.06), (0.03, 0.2, 0.03), STEEL),
        box((0, 0.97, 0.12), (0.03, 0.025, 0.14), STEEL),
    ]
    return join(parts)


def mirror(width: float) -> Mesh:
    """A framed mirror for the wall, from 1.15 to 1.85 m."""
    half, low, high = width / 2, 1.15, 1.85
    face = [(-half, low, 0.031), (half, low, 0.031), (half, high, 0.031), (-half, high, 0.031)]
    streaks = [[MIRROR, shade(MIRROR, 1.12), shade(MIRROR, 1.25), shade(MIRROR, 0.95)]]
    return join([box((0, low - 0.02, 0.015), (width + 0.04, 0.74, 0.03), STEEL), quads([face], streaks)])


def bathtub(rng: np.random.Generator, length: float) -> Mesh:
    """A tub along x with its hollow, tap and drain end."""
    depth, height, rim = 0.74, between(rng, 0.5, 0.58), 0.07
    half, inner = length / 2, length / 2 - rim
    walls = [
        box((0, 0, rim / 2), (length, height, rim), CERAMIC),
        box((0, 0, depth - rim / 2), (length, height, rim), CERAMIC),
        *(box((x * (half - rim / 2), 0, depth / 2), (rim, height, depth - 2 * rim), CERAMIC) for x in (-1, 1)),
    ]
    floor = [(-inner, 0.12, rim), (inner, 0.12, rim), (inner, 0.12, depth - rim), (-inner, 0.12, depth - rim)]
    basin = quads([floor], _WATER if chance(rng, 0.4) else shade(CERAMIC, 0.9), toward=(0, 5, 0))
    tap = [
        box((half - 0.1, height, 0.2), (0.04, 0.14, 0.04), STEEL),
        box((half - 0.15, height + 0.12, 0.2), (0.12, 0.03, 0.03), STEEL),
    ]
    return join([*walls, basin, *tap])


def shower(rng: np.random.Generator, style: Style, size: float) -> Mesh:
    """A shower: a tray under a steel frame, a curtain drawn half back, tiles behind, a pole with its head."""
    cloth = pick_varied(rng, (WHITE, *style.accents))
    tray = cushion((0, 0, size / 2), (size, 0.09, size), CERAMIC, 0.02)
    half = size / 2 - 0.02
    posts = [
        box((x, 0.05, z), (0.035, 1.9, 0.035), STEEL)
        for x, z in ((-half, size - 0.02), (half, size - 0.02), (-half, 0.02))
    ]
    rails = [box((0, y, size - 0.02), (size - 0.04, 0.03, 0.03), STEEL) for y in (1.92, 0.12)]
    folds = [
        box(
            (-half, 0.25, 0.06 + 0.05 * fold),
            (0.05 if fold % 2 else 0.02, 1.66, 0.05),
            shade(cloth, 1 - 0.06 * (fold % 2)),
        )
        for fold in range(7)
    ]
    back = box((0, 0.09, 0.008), (size, 1.9, 0.016), varied(rng, style.tiles[1], 0.03))
    head = [
        rod((0.1, 1.0, 0.05), (0.1, 2.02, 0.05), 0.025, STEEL),
        rod((0.1, 2.02, 0.05), (0.1, 1.98, 0.28), 0.025, STEEL),
        cylinder((0.1, 1.95, 0.28), 0.09, 0.02, STEEL, 8),
    ]
    return join([tray, *posts, *rails, *folds, back, *head])


def towel_rail(rng: np.random.Generator, style: Style) -> Mesh:
    """A rail with two towels on it, for the wall."""
    towels = [
        box((x, 1.35 - drop, 0.05), (0.24, drop, 0.045), pick_varied(rng, style.accents))
        for x, drop in ((-0.14, between(rng, 0.4, 0.6)), (0.14, between(rng, 0.35, 0.5)))
    ]
    return join([box((0, 1.34, 0.045), (0.62, 0.025, 0.025), STEEL), *towels])
