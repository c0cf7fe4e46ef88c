"""Wardrobes, bookshelves, dressers, low cabinets, coat racks."""

import numpy as np

from thinknav_sim.homes.draw import between, chance, pick
from thinknav_sim.homes.materials import BOOKS, WHITE, Style, pick_varied, shade, varied
from thinknav_sim.homes.mesh import Color, Mesh, box, ellipsoid, join, panel, revolve


def _fronted(
    width: float, height: float, depth: float, columns: int, rows: int, body: Color, front: Color, knob: Color
) -> list[Mesh]:
    """A closed body with a grid of doors or drawers and a handle on each."""
    plinth = 0.07
    parts = [
        box((0, 0, depth / 2 - 0.02), (width - 0.04, plinth, depth - 0.06), shade(body, 0.6)),
        box((0, plinth, (depth - 0.02) / 2), (width, height - plinth, depth - 0.02), body),
    ]
    cell, rise = width / columns, (height - plinth) / rows
    for column in range(columns):
        for row in range(rows):
            x, y = (column + 0.5) * cell - width / 2, plinth + row * rise
            parts.append(panel((x, y + 0.015, depth - 0.01), (cell - 0.02, rise - 0.03, 0.02), front))
            if rise > cell:  # a door: its handle stands upright, beside the neighbour's
                grip = x + (cell / 2 - 0.06) * (1 if column % 2 == 0 else -1)
                parts.append(panel((grip, y + rise * 0.45, depth + 0.01), (0.02, min(0.2, rise / 3), 0.02), knob))
            else:
                parts.append(panel((x, y + rise * 0.62, depth + 0.01), (min(0.16, cell / 2), 0.02, 0.02), knob))
    return parts


def wardrobe(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """A tall closet with two or three doors."""
    body = pick_varied(rng, (style.wood, style.light_wood, WHITE))
    height = between(rng, 1.95, 2.2)
    columns = 3 if width > 1.4 else 2
    return join(_fronted(width, height, 0.6, columns, 1, body, shade(body, 1.07), style.metal))


def dresser(rng: np.random.Generator, style: Style, width: float, height: float) -> Mesh:
    """A chest of drawers."""
    body = pick_varied(rng, (style.wood, style.light_wood))
    return join(_fronted(width, height, 0.44, 2, 3, body, shade(body, 1.1), style.metal))


def sideboard(rng: np.random.Generator, style: Style, width: float, height: float, depth: float = 0.42) -> Mesh:
    """A low cabinet with doors, for a wall or under a television."""
    body = pick_varied(rng, (style.wood, style.wood, WHITE))
    front = shade(body, 1.1) if chance(rng, 0.6) else varied(rng, style.light_wood)
    return join(_fronted(width, height, depth, 3 if width > 1.2 else 2, 1, body, front, style.metal))


def bookshelf(rng: np.random.Generator, style: Style, width: float) -> Mesh:
    """An open shelf, its boards filled with books and a few other things."""
    wood = pick_varied(rng, (style.wood, style.light_wood, WHITE))
    height, depth, boards = between(rng, 1.5, 1.95), 0.3, 4
    rise = (height - 0.06) / boards
    parts = [box((x * (width / 2 - 0.015), 0, depth / 2), (0.03, height, depth), wood) for x in (-1, 1)]
    parts += [box((0, 0.04, 0.01), (width - 0.06, height - 0.04, 0.02), shade(wood, 0.7))]
    for level in range(boards + 1):
        parts.append(box((0, 0.03 + level * rise, depth / 2), (width - 0.06, 0.025, depth), wood))
    for level in range(boards):
        parts += _row(rng, style, width - 0.1, 0.055 + level * rise, rise - 0.05, depth)
    return join(parts)


def _row(rng: np.random.Generator, style: Style, width: float, y: float, room: float, depth: float) -> list[Mesh]:
    """What stands on one board: blocks of books of one height, gaps, now and then a vase or a box."""
    parts: list[Mesh] = []
    x = -width / 2
    while x < width / 2 - 0.12:
        kind = pick(rng, ("books", "books", "gap", "vase", "box"))
        span = min(between(rng, 0.10, 0.22), width / 2 - x)
        middle = (x + span / 2, y, depth / 2)
        if kind == "books":
            parts += books(rng, (x, y, depth * 0.5), span, room * between(rng, 0.62, 0.9), depth * 0.7)
        elif kind == "vase":
            profile = ((0.035, 0.0), (0.06, room * 0.35), (0.03, room * 0.6), (0.0, room * 0.6))
            parts.append(revolve(middle, profile, pick_varied(rng, style.accents), 6))
        elif kind == "box":
            parts.append(panel(middle, (span * 0.9, room * 0.55, depth * 0.7), pick_varied(rng, style.accents)))
        x += span
    return parts


def books(
    rng: np.random.Generator, start: tuple[float, float, float], span: float, height: float, depth: float
) -> list[Mesh]:
    """Upright books from `start` along +x."""
    parts = []
    x, y, z = start
    end = x + span
    while x < end - 0.03:
        thick = min(between(rng, 0.045, 0.1), end - x)
        size = (thick - 0.003, height * between(rng, 0.85, 1.0), depth)
        parts.append(panel((x + thick / 2, y, z), size, pick_varied(rng, BOOKS)))
        x += thick
    return parts


def coat_rack(rng: np.random.Generator, style: Style) -> Mesh:
    """A board with hooks and coats over a shoe cabinet."""
    cabinet = _fronted(0.8, 0.5, 0.32, 2, 1, style.cabinet, shade(style.cabinet, 1.05), style.metal)
    board = box((0, 1.62, 0.02), (0.8, 0.12, 0.04), style.wood)
    coats = []
    for x in (-0.25, 0.0, 0.25):
        if chance(rng, 0.7):
            cloth = pick_varied(rng, (style.sofa, style.seat, *style.accents))
            length = between(rng, 0.6, 0.85)
            coats.append(
                revolve((x, 1.64 - length, 0.11), ((0.13, 0), (0.11, length * 0.8), (0.02, length)), cloth, 7, (1, 0.7))
            )
    shoes = [ellipsoid((x, 0.54, 0.16), (0.05, 0.04, 0.12), pick_varied(rng, BOOKS), 6) for x in (-0.28, -0.17)]
    return join([*cabinet, board, *coats, *shoes])
