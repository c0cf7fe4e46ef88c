"""Surface colours (sRGB, 0..1) and the style of a home: which of them its floors, walls and furniture share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thinknav_sim.homes.draw import pick, shuffled
from thinknav_sim.homes.mesh import Color

WHITE: Color = (0.95, 0.95, 0.94)
CERAMIC: Color = (0.97, 0.97, 0.98)
STEEL: Color = (0.68, 0.70, 0.72)
DARK_METAL: Color = (0.22, 0.22, 0.24)
BLACK: Color = (0.09, 0.09, 0.11)
SCREEN: Color = (0.07, 0.08, 0.11)
LAMP_GLOW: Color = (1.15, 1.08, 0.92)
SKY_TOP: Color = (0.80, 0.92, 1.20)
SKY_LOW: Color = (1.12, 1.14, 1.12)
GLASS: Color = (0.72, 0.82, 0.88)
MIRROR: Color = (0.78, 0.85, 0.90)
SOIL: Color = (0.28, 0.20, 0.15)
CEILING: Color = (0.97, 0.97, 0.96)
OUTSIDE: Color = (0.48, 0.46, 0.45)

WOODS: tuple[Color, ...] = (
    (0.72, 0.54, 0.36),  # oak
    (0.46, 0.31, 0.21),  # walnut
    (0.84, 0.71, 0.53),  # birch
    (0.60, 0.40, 0.26),  # cherry
    (0.36, 0.26, 0.20),  # wenge
)
FLOOR_WOODS: tuple[Color, ...] = (
    (0.68, 0.52, 0.37),
    (0.54, 0.38, 0.26),
    (0.76, 0.65, 0.51),
    (0.60, 0.54, 0.47),
)
TILES: tuple[tuple[Color, Color], ...] = (
    ((0.83, 0.84, 0.85), (0.74, 0.77, 0.79)),
    ((0.85, 0.81, 0.74), (0.76, 0.70, 0.62)),
    ((0.55, 0.60, 0.64), (0.47, 0.52, 0.56)),
    ((0.90, 0.90, 0.89), (0.35, 0.37, 0.40)),
)
WALL_TINTS: tuple[Color, ...] = (
    (0.93, 0.91, 0.87),
    (0.90, 0.88, 0.80),
    (0.82, 0.87, 0.90),
    (0.84, 0.89, 0.82),
    (0.93, 0.86, 0.80),
    (0.87, 0.84, 0.90),
    (0.88, 0.88, 0.88),
    (0.95, 0.91, 0.78),
)
BATH_TINTS: tuple[Color, ...] = ((0.78, 0.88, 0.90), (0.92, 0.94, 0.95), (0.82, 0.90, 0.86), (0.90, 0.87, 0.83))
FABRICS: tuple[Color, ...] = (
    (0.42, 0.46, 0.52),  # slate
    (0.62, 0.58, 0.52),  # taupe
    (0.28, 0.38, 0.50),  # navy
    (0.50, 0.30, 0.27),  # rust
    (0.40, 0.48, 0.38),  # sage
    (0.66, 0.52, 0.33),  # ochre
    (0.47, 0.35, 0.42),  # plum
    (0.36, 0.33, 0.32),  # charcoal
)
ACCENTS: tuple[Color, ...] = (
    (0.80, 0.45, 0.30),
    (0.88, 0.72, 0.35),
    (0.35, 0.55, 0.62),
    (0.85, 0.82, 0.76),
    (0.60, 0.28, 0.30),
    (0.45, 0.58, 0.45),
)
BEDDING: tuple[Color, ...] = (
    (0.90, 0.90, 0.92),
    (0.64, 0.73, 0.82),
    (0.84, 0.76, 0.68),
    (0.68, 0.76, 0.68),
    (0.74, 0.64, 0.72),
    (0.40, 0.47, 0.60),
)
CABINETS: tuple[Color, ...] = (
    (0.92, 0.92, 0.90),
    (0.50, 0.58, 0.60),
    (0.55, 0.62, 0.52),
    (0.78, 0.66, 0.50),
    (0.33, 0.37, 0.44),
)
COUNTERTOPS: tuple[Color, ...] = ((0.35, 0.34, 0.34), (0.78, 0.76, 0.73), (0.62, 0.46, 0.31), (0.52, 0.52, 0.54))
GREENS: tuple[Color, ...] = ((0.24, 0.48, 0.22), (0.34, 0.56, 0.28), (0.20, 0.40, 0.26), (0.46, 0.60, 0.30))
POTS: tuple[Color, ...] = ((0.74, 0.42, 0.29), (0.90, 0.89, 0.86), (0.32, 0.34, 0.37), (0.55, 0.63, 0.66))
BOOKS: tuple[Color, ...] = (
    (0.62, 0.22, 0.20),
    (0.20, 0.34, 0.52),
    (0.24, 0.42, 0.30),
    (0.80, 0.70, 0.45),
    (0.86, 0.84, 0.80),
    (0.30, 0.24, 0.32),
    (0.78, 0.48, 0.26),
)


@dataclass(frozen=True)
class Style:
    """The materials that a home's rooms and furniture share."""

    wood: Color
    light_wood: Color
    floor_wood: Color
    tiles: tuple[Color, Color]
    trim: Color
    sofa: Color
    seat: Color
    accents: tuple[Color, ...]
    bedding: tuple[Color, ...]
    cabinet: Color
    countertop: Color
    pot: Color
    metal: Color
    wall_tints: tuple[Color, ...]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Style":
        """A style for one home."""
        woods = shuffled(rng, WOODS)
        fabrics = shuffled(rng, FABRICS)
        return cls(
            wood=woods[0],
            light_wood=woods[1],
            floor_wood=pick(rng, FLOOR_WOODS),
            tiles=pick(rng, TILES),
            trim=pick(rng, (WHITE, WHITE, woods[0])),
            sofa=fabrics[0],
            seat=fabrics[1],
            accents=tuple(shuffled(rng, ACCENTS)),
            bedding=tuple(shuffled(rng, BEDDING)),
            cabinet=pick(rng, CABINETS),
            countertop=pick(rng, COUNTERTOPS),
            pot=pick(rng, POTS),
            metal=pick(rng, (STEEL, DARK_METAL)),
            wall_tints=tuple(shuffled(rng, WALL_TINTS)),
        )


def shade(color: Color, factor: float) -> Color:
    """A lighter (factor above 1) or darker colour."""
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def mix(first: Color, second: Color, share: float) -> Color:
    """`first`, with this share of `second`."""
    red, green, blue = (a + (b - a) * share for a, b in zip(first, second, strict=True))
    return (red, green, blue)


def varied(rng: np.random.Generator, color: Color, amount: float = 0.06) -> Color:
    """The colour, a little lighter or darker: no two planks are the same."""
    return shade(color, 1 + amount * (2 * float(rng.random()) - 1))


def pick_varied(rng: np.random.Generator, colors: Sequence[Color]) -> Color:
    """One of the colours, a little varied."""
    return varied(rng, pick(rng, colors))
