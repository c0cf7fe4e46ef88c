"""Points over triangles: on them, dense enough, each with its triangle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from thinknav_sim.sampling import points_on


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 3]), st.floats(0.05, 2.0))
def test_every_place_on_a_triangle_has_a_point_near(seed: int, dimensions: int, spacing: float) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-1, 1, (3, 3, dimensions)).astype(np.float32)
    points, owners = points_on(triangles, spacing)
    weights = rng.dirichlet((1, 1, 1), 50)
    for index in range(3):
        own = points[owners == index]
        assert cKDTree(own).query(weights @ triangles[index])[0].max() <= spacing
        assert cKDTree(own).query(triangles[index])[0].max() < 1e-6


def test_no_triangles_have_no_points() -> None:
    points, owners = points_on(np.empty((0, 3, 3)), 0.1)
    assert (points.shape, owners.shape) == ((0, 3), (0,))


@pytest.mark.parametrize(("most", "count"), [(200, 66), (4, 15)])
def test_points_along_an_edge_are_bounded(most: int, count: int) -> None:
    points, _ = points_on(np.array([[[0.0, 0], [1, 0], [0, 0.5]]]), 1.15 / 10.2, most)
    assert len(points) == count
