"""Pieces of furniture: their frames, sizes, normals and colours, over many draws."""

from collections.abc import Callable

import numpy as np
import pytest

from thinknav_sim.homes.draw import stream
from thinknav_sim.homes.furniture import bathroom, beds, decor, electronics, kitchen, plants, seats, storage, tables
from thinknav_sim.homes.materials import Style
from thinknav_sim.homes.mesh import Mesh

Builder = Callable[[np.random.Generator, Style], Mesh]

# For each piece: how to build it, and the least and the most that its width, height and depth may be.
PIECES: dict[str, tuple[Builder, tuple[float, float, float], tuple[float, float, float]]] = {
    "dining chair": (seats.dining_chair, (0.38, 0.80, 0.40), (0.50, 1.05, 0.60)),
    "office chair": (seats.office_chair, (0.50, 0.95, 0.50), (0.65, 1.15, 0.70)),
    "armchair": (seats.armchair, (0.65, 0.70, 0.65), (0.90, 0.95, 0.85)),
    "sofa": (lambda rng, style: seats.sofa(rng, style, 3), (1.9, 0.70, 0.80), (2.6, 0.95, 1.0)),
    "bed": (lambda rng, style: beds.bed(rng, style, 1.6), (1.55, 0.80, 2.0), (1.75, 1.2, 2.25)),
    "nightstand": (beds.nightstand, (0.35, 0.40, 0.30), (0.55, 0.65, 0.50)),
    "dining table": (lambda rng, style: tables.dining_table(rng, style, 1.6, 0.9), (1.6, 0.7, 0.9), (1.6, 0.8, 0.9)),
    "coffee table": (lambda rng, style: tables.coffee_table(rng, style, 1.0), (0.7, 0.35, 0.5), (1.0, 0.5, 0.75)),
    "desk": (lambda rng, style: tables.desk(rng, style, 1.3), (1.3, 0.7, 0.5), (1.3, 0.8, 0.7)),
    "wardrobe": (lambda rng, style: storage.wardrobe(rng, style, 1.6), (1.55, 1.9, 0.55), (1.6, 2.3, 0.7)),
    "bookshelf": (lambda rng, style: storage.bookshelf(rng, style, 0.9), (0.9, 1.5, 0.25), (0.9, 2.1, 0.35)),
    "toilet": (bathroom.toilet, (0.36, 0.70, 0.60), (0.65, 1.15, 0.75)),
    "washstand": (lambda rng, style: bathroom.washstand(rng, style, 0.8), (0.75, 0.75, 0.4), (0.9, 1.1, 0.6)),
    "bathtub": (lambda rng, style: bathroom.bathtub(rng, 1.6), (1.6, 0.5, 0.7), (1.6, 0.8, 0.8)),
    "fridge": (kitchen.fridge, (0.55, 1.6, 0.55), (0.7, 2.0, 0.75)),
    "television": (lambda rng, style: electronics.television(rng, style, 1.2), (1.2, 0.7, 0.1), (1.2, 0.85, 0.3)),
    "floor plant": (plants.floor_plant, (0.25, 0.6, 0.25), (0.75, 1.75, 0.75)),
    "floor lamp": (decor.floor_lamp, (0.25, 1.4, 0.25), (0.45, 1.85, 0.5)),
}


@pytest.mark.parametrize("name", PIECES)
def test_piece(name: str) -> None:
    build, least, most = PIECES[name]
    looks = set()
    for seed in range(12):
        rng = stream(seed)
        mesh = build(rng, Style.draw(rng))
        low, size = mesh.low, mesh.high - mesh.low
        assert -0.001 < low[1] < (0.25 if name == "washstand" else 0.05), "stands on the floor or hangs low"
        assert low[2] > -0.02, "its back is at z = 0"
        assert abs(low[0] + mesh.high[0]) < 0.16, "x = 0 is about its middle"
        assert (size >= np.array(least) - 1e-9).all(), (seed, size)
        assert (size <= np.array(most) + 1e-9).all(), (seed, size)
        np.testing.assert_allclose((mesh.normals**2).sum(axis=1), 1.0, atol=1e-9)
        assert mesh.colors.min() >= 0
        assert mesh.triangles.max() < len(mesh.vertices)
        looks.add((len(mesh.triangles), tuple(np.round(mesh.colors.mean(axis=0), 2))))
    assert len(looks) >= 2, "homes differ in their furniture"
