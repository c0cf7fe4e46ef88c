"""Chairs, armchairs and sofas."""

import math

import numpy as np

from thinknav_sim.homes.draw import between, chance, pick
from thinknav_sim.homes.materials import BLACK, DARK_METAL, Style, pick_varied, shade, varied
from thinknav_sim.homes.mesh import Color, Mesh, box, cushion, cylinder, join, rod


def _legs(width: float, depth: float, height: float, thickness: float, color: Color, splay: float = 0.0) -> list[Mesh]:
    """Four legs under a seat of this width and depth, their feet `splay` further out."""
    legs = []
    for x in (-1, 1):
        for z in (0, 1):
            top = (x * (width / 2 - 0.04), height, 0.05 + z * (depth - 0.09))
            foot = (top[0] + x * splay, 0.0, top[2] + (2 * z - 1) * splay)
            legs.append(rod(foot, top, thickness, color))
    return legs


def dining_chair(rng: np.random.Generator, style: Style) -> Mesh:
    """A wooden chair, a moulded one on slanted legs, or an upholstered one with a high back."""
    return pick(rng, (_slatted_chair, _moulded_chair, _upholstered_chair))(rng, style)


def _slatted_chair(rng: np.random.Generator, style: Style) -> Mesh:
    wood, height = varied(rng, style.wood), between(rng, 0.86, 0.96)
    slats = [box((0, y, 0.035), (0.36, 0.06, 0.02), wood) for y in (0.56, 0.68, height - 0.09)]
    posts = [box((x, 0.47, 0.035), (0.035, height - 0.47, 0.035), wood) for x in (-0.19, 0.19)]
    seat = cushion((0, 0.43, 0.23), (0.43, 0.05, 0.42), style.seat if chance(rng, 0.5) else wood, 0.015)
    return join([*_legs(0.42, 0.42, 0.44, 0.036, wood), seat, *posts, *slats])


def _moulded_chair(rng: np.random.Generator, style: Style) -> Mesh:
    shell = pick_varied(rng, style.accents)
    leg = style.light_wood if chance(rng, 0.6) else DARK_METAL
    seat = cushion((0, 0.42, 0.25), (0.45, 0.05, 0.42), shell, 0.02)
    back = [
        box((0, 0.46, 0.055), (0.40, 0.20, 0.035), shell),
        box((0, 0.66, 0.035), (0.44, 0.18, 0.035), shade(shell, 1.04)),
        *(box((x, 0.46, 0.14), (0.03, 0.12, 0.18), shade(shell, 0.92)) for x in (-0.21, 0.21)),
    ]
    return join([*_legs(0.34, 0.40, 0.43, 0.032, leg, splay=0.04), seat, *back])


def _upholstered_chair(rng: np.random.Generator, style: Style) -> Mesh:
    cloth = varied(rng, style.seat)
    seat = cushion((0, 0.38, 0.25), (0.46, 0.12, 0.44), cloth, 0.03)
    back = cushion((0, 0.46, 0.055), (0.44, between(rng, 0.44, 0.54), 0.08), shade(cloth, 0.94), 0.03)
    return join([*_legs(0.42, 0.44, 0.39, 0.034, shade(style.wood, 0.7)), seat, back])


def office_chair(rng: np.random.Generator, style: Style) -> Mesh:
    """A swivel chair on a five-armed foot."""
    cloth = pick_varied(rng, (BLACK, style.seat, style.sofa))
    middle = 0.31
    arms = []
    for step in range(5):
        turn = 2 * math.pi * step / 5
        tip = (0.27 * math.sin(turn), 0.05, middle + 0.27 * math.cos(turn))
        arms.append(rod((0, 0.09, middle), tip, 0.045, DARK_METAL))
        arms.append(rod((tip[0], 0.0, tip[2]), (tip[0], 0.07, tip[2]), 0.05, BLACK))
    post = cylinder((0, 0.07, middle), 0.03, 0.36, style.metal, 6)
    seat = cushion((0, 0.42, middle), (0.50, 0.09, 0.48), cloth, 0.03)
    back = cushion((0, 0.58, 0.08), (0.45, 0.48, 0.08), shade(cloth, 0.95), 0.03)
    spine = box((0, 0.44, 0.06), (0.07, 0.16, 0.05), DARK_METAL)
    rests = [box((x, 0.64, middle), (0.05, 0.03, 0.26), BLACK) for x in (-0.27, 0.27)]
    props = [box((x, 0.48, middle), (0.03, 0.16, 0.04), BLACK) for x in (-0.265, 0.265)]
    return join([*arms, post, seat, back, spine, *rests, *props])


def armchair(rng: np.random.Generator, style: Style) -> Mesh:
    """A padded chair with arms: boxy, or a slim one on a wooden frame."""
    cloth = pick_varied(rng, (style.seat, style.sofa, *style.accents[:2]))
    if chance(rng, 0.5):
        parts = [box((0, 0.08, 0.40), (0.56, 0.22, 0.74), shade(cloth, 0.9))]
        parts += [cushion((x, 0.08, 0.40), (0.15, 0.50, 0.76), shade(cloth, 0.96), 0.03) for x in (-0.34, 0.34)]
        parts += [cushion((0, 0.08, 0.10), (0.54, 0.74, 0.18), cloth, 0.05)]
        parts += [cushion((0, 0.30, 0.48), (0.52, 0.14, 0.56), shade(cloth, 1.06), 0.04)]
        parts += [box((x, 0, z), (0.05, 0.08, 0.05), style.wood) for x in (-0.36, 0.36) for z in (0.08, 0.72)]
        return join(parts)
    wood = varied(rng, style.wood)
    parts = _legs(0.66, 0.68, 0.58, 0.045, wood)
    parts += [box((x, 0.56, 0.38), (0.06, 0.035, 0.68), wood) for x in (-0.31, 0.31)]
    parts += [box((0, 0.26, 0.38), (0.58, 0.05, 0.62), wood)]
    parts += [cushion((0, 0.31, 0.42), (0.56, 0.13, 0.60), cloth, 0.04)]
    parts += [cushion((0, 0.40, 0.11), (0.56, 0.46, 0.14), shade(cloth, 0.95), 0.04)]
    return join(parts)


def sofa(rng: np.random.Generator, style: Style, places: int) -> Mesh:
    """A sofa of two or three places: back, arms, a cushion a place, throw pillows, short legs."""
    cloth = varied(rng, style.sofa)
    arm = pick(rng, (0.12, 0.2))
    place = between(rng, 0.60, 0.68)
    inner, depth, rise = places * place, between(rng, 0.84, 0.92), between(rng, 0.06, 0.12)
    width, back_height = inner + 2 * arm, between(rng, 0.76, 0.86)
    parts = [
        box((0, rise, depth / 2), (width - 0.02, 0.20, depth - 0.04), shade(cloth, 0.86)),
        cushion((0, rise, 0.10), (inner, back_height - rise, 0.2), shade(cloth, 0.92), 0.05),
    ]
    arm_height = between(rng, 0.56, 0.64) - rise
    for side in (-1, 1):
        parts.append(cushion((side * (inner + arm) / 2, rise, depth / 2), (arm, arm_height, depth), shade(cloth, 0.95)))
        parts += [
            box((side * (width / 2 - 0.07), 0, z), (0.05, rise, 0.05), shade(style.wood, 0.7))
            for z in (0.08, depth - 0.08)
        ]
    for index in range(places):
        x = (index + 0.5) * place - inner / 2
        parts.append(cushion((x, rise + 0.2, depth / 2 + 0.1), (place - 0.015, 0.15, depth - 0.22), shade(cloth, 1.05)))
        parts.append(cushion((x, rise + 0.33, 0.25), (place - 0.03, 0.34, 0.15), shade(cloth, 1.0), 0.05))
    for side in (-1, 1):
        if chance(rng, 0.75):
            pillow = pick_varied(rng, style.accents)
            parts.append(cushion((side * (inner / 2 - 0.22), rise + 0.35, 0.38), (0.38, 0.34, 0.13), pillow, 0.05))
    return join(parts)
