"""Televisions and monitors."""

import numpy as np

from thinknav_sim.homes.draw import between, chance
from thinknav_sim.homes.materials import BLACK, SCREEN, Style, mix, shade
from thinknav_sim.homes.mesh import Mesh, box, join, quads, rod


def _panel(width: float, height: float, y: float, z: float) -> list[Mesh]:
    """A dark screen in its bezel, with a faint reflection across one corner."""
    half, front = width / 2 - 0.015, z + 0.021
    face = [
        (-half, y + 0.015, front),
        (half, y + 0.015, front),
        (half, y + height - 0.015, front),
        (-half, y + height - 0.015, front),
    ]
    sheen = mix(SCREEN, (0.42, 0.50, 0.60), 0.55)
    shades = [[SCREEN, SCREEN, shade(SCREEN, 1.5), sheen]]
    return [box((0, y, z), (width, height, 0.04), BLACK), quads([face], shades)]


def television(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """A television on a foot or on two feet, back at z = 0, to stand on a cabinet."""
    height = round(width * 0.57, 2)
    if chance(rng, 0.5):
        feet = [
            box((0, 0, 0.11), (width * 0.35, 0.02, 0.22), style.metal),
            box((0, 0.02, 0.08), (0.07, 0.08, 0.04), BLACK),
        ]
    else:
        feet = [
            rod((x * width * 0.36, 0.0125, 0.1 + z), (x * width * 0.33, 0.1, 0.1), 0.025, BLACK)
            for x in (-1, 1)
            for z in (-0.1, 0.1)
        ]
    return join([*_panel(width, height, 0.07, 0.1), *feet])


def wall_television(rng: np.random.Generator, width: float) -> Mesh:
    """A television on a wall, its lower edge at about 0.8 m."""
    bottom = between(rng, 0.75, 0.9)
    return join(
        [box((0, bottom + 0.15, 0.02), (0.3, 0.25, 0.04), BLACK), *_panel(width, round(width * 0.57, 2), bottom, 0.06)]
    )


def monitor(style: Style) -> Mesh:
    """A computer screen on its foot, for a desk."""
    foot = [box((0, 0, 0.12), (0.24, 0.015, 0.2), style.metal), box((0, 0.015, 0.1), (0.05, 0.16, 0.03), style.metal)]
    return join([*_panel(0.6, 0.36, 0.13, 0.13), *foot])


def keyboard() -> Mesh:
    """A keyboard and a mouse, for a desk."""
    return join(
        [box((-0.06, 0, 0), (0.42, 0.02, 0.14), (0.25, 0.25, 0.27)), box((0.24, 0, 0), (0.06, 0.03, 0.1), BLACK)]
    )
