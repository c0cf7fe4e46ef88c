"""Solids: closed, outward normals, sizes, and exact quarter turns."""

import math

import numpy as np
import pytest

from thinknav_sim.homes.mesh import Mesh, box, cushion, cylinder, ellipsoid, grid, join, leaf, quads, revolve, rod

WHITE = (1.0, 1.0, 1.0)
BASE = (1.0, 2.0, 3.0)


def volume(mesh: Mesh) -> float:
    """Of a closed mesh, by the divergence theorem over its shading normals."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    faces = np.cross(b - a, c - a)
    normals = mesh.normals[mesh.triangles].mean(axis=1)
    outward = np.sign((faces * normals).sum(axis=1))
    return float(((a * faces).sum(axis=1) * outward).sum() / 6)


def test_box_is_closed_and_sized() -> None:
    mesh = box(BASE, (0.4, 0.6, 0.8), WHITE)
    assert volume(mesh) == pytest.approx(0.4 * 0.6 * 0.8)
    np.testing.assert_allclose(mesh.low, (0.8, 2.0, 2.6))
    np.testing.assert_allclose(mesh.high, (1.2, 2.6, 3.4))


def test_box_on_the_floor_has_no_bottom() -> None:
    assert len(box((0, 0, 0), (1, 1, 1), WHITE).triangles) == 10
    assert len(box((0, 0.1, 0), (1, 1, 1), WHITE).triangles) == 12


def test_cushion_is_a_box_less_its_upper_edges() -> None:
    mesh = cushion((0.0, 0.0, 0.0), (1.0, 0.3, 1.0), WHITE, bevel=0.1)  # its missing bottom, at y = 0, adds nothing
    frustum = 0.1 / 3 * (1.0 + 0.8 * 0.8 + 0.8)
    assert volume(mesh) == pytest.approx(0.2 + frustum)


def test_round_solids_have_their_volume() -> None:
    sides = 40
    polygon = sides / 2 * math.sin(2 * math.pi / sides)
    drum = revolve(BASE, ((0.0, 0.0), (0.5, 0.0), (0.5, 2.0), (0.0, 2.0)), WHITE, sides)
    assert volume(drum) == pytest.approx(polygon * 0.25 * 2.0)
    oval = revolve(BASE, ((0.0, 0.0), (0.5, 0.0), (0.5, 2.0), (0.0, 2.0)), WHITE, sides, (1.0, 0.5))
    assert volume(oval) == pytest.approx(polygon * 0.25)
    assert 0.5 < volume(ellipsoid(BASE, (0.5, 0.5, 0.5), WHITE, 20)) / (math.pi / 6) < 1.0
    assert cylinder((0, 0, 0), 0.1, 0.5, WHITE).high[1] == 0.5


@pytest.mark.parametrize("end", [(0.0, 1.0, 0.0), (0.3, 1.0, 0.2), (0.5, 0.1, 0.2)])
def test_rod_faces_outwards(end: tuple[float, float, float]) -> None:
    mesh = rod((0, 0, 0), end, 0.1, WHITE)
    middle = np.array(end) / 2
    assert (((mesh.vertices - middle) * mesh.normals).sum(axis=1) > 0).all()


def test_quads_look_where_they_are_told() -> None:
    face = [[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]]
    np.testing.assert_allclose(quads(face, WHITE).normals, [(0, 0, 1)] * 4)
    np.testing.assert_allclose(quads(face, WHITE, toward=(0, 0, -5)).normals, [(0, 0, -1)] * 4)


def test_grid_covers_its_area_once() -> None:
    cells = grid((0, 1, 4), (0, 2, 3))
    assert cells.shape == (4, 4, 2)
    areas = (cells[:, 2] - cells[:, 0]).prod(axis=1)
    assert areas.sum() == 12


def test_turns() -> None:
    mesh = box((0, 0, 1), (0.2, 0.2, 0.2), WHITE)
    centers = [(mesh.quarter_turned(q).low + mesh.quarter_turned(q).high)[[0, 2]] / 2 for q in range(5)]
    np.testing.assert_array_equal(np.round(centers, 12), [(0, 1), (1, 0), (0, -1), (-1, 0), (0, 1)])
    np.testing.assert_allclose(mesh.turned(math.pi / 2).vertices, mesh.quarter_turned(1).vertices, atol=1e-12)


def test_join_keeps_every_triangle() -> None:
    parts = [box((x, 0, 0), (0.5, 1, 1), WHITE) for x in range(3)]
    mesh = join(parts)
    assert len(mesh.triangles) == 30
    for index in range(3):
        third = mesh.vertices[mesh.triangles[index * 10 : index * 10 + 10]]
        np.testing.assert_array_equal(third, parts[index].vertices[parts[index].triangles])


def test_leaf_spans_its_points() -> None:
    mesh = leaf((0, 0, 0), (0.3, 0.4, 0.0), 0.1, WHITE)
    assert len(mesh.triangles) == 2
    assert mesh.high[0] == pytest.approx(0.3)
