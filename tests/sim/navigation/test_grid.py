"""Where one can stand: room, walls, thin posts, low and high things, sealed spaces."""

import numpy as np
import pytest

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene, SceneError

RADIUS = 0.18


def stands(grid: NavigationGrid, x: float, z: float) -> bool:
    return bool(grid.is_navigable(np.array([[x, 0.0, z]]))[0])


def test_the_body_keeps_its_radius_from_walls(empty_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(empty_room, renderer, radius=RADIUS)
    rows, cols = np.nonzero(grid.navigable)
    reached = grid.positions(rows, cols)[:, [0, 2]]
    # Cells are 5 cm: the nearest centres stand off by the radius, and by one cell more at the most.
    assert np.all((reached.min(axis=0) >= RADIUS) & (reached.min(axis=0) <= RADIUS + 0.075))
    assert np.all((6.0 - reached.max(axis=0) >= RADIUS) & (6.0 - reached.max(axis=0) <= RADIUS + 0.075))


@pytest.mark.parametrize(
    ("box", "blocks"),
    [
        ((2.99, 0.0, 2.99, 3.0, 2.0, 3.0), True),  # a post of 1 cm
        ((2.5, 0.6, 2.5, 3.5, 0.65, 3.5), True),  # a table top
        ((2.5, 0.0, 2.5, 3.5, 0.02, 3.5), False),  # a rug
        ((2.5, 1.2, 2.5, 3.5, 2.0, 3.5), False),  # a shelf above the head
        ((2.5, 0.0, 2.5, 3.5, 2.0, 3.5), True),  # a wardrobe: nobody stands inside it either
    ],
)
def test_what_blocks(make_room, renderer: Renderer, box: tuple[float, ...], blocks: bool) -> None:  # type: ignore[no-untyped-def]
    grid = NavigationGrid.from_scene(make_room(walls=[box]), renderer, radius=RADIUS)
    assert stands(grid, 3.0, 3.0) is not blocks
    assert stands(grid, 1.0, 1.0)


def test_the_floor_has_the_height_of_what_lies_on_it(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    grid = NavigationGrid.from_scene(make_room(walls=[(2.5, 0.0, 2.5, 3.5, 0.02, 3.5)]), renderer)
    rows, cols = grid.cells(np.array([[3.0, 0.0, 3.0], [1.0, 0.0, 1.0]]))
    np.testing.assert_allclose(grid.floor[rows, cols], [0.02, 0.0], atol=1e-5)


def test_a_room_that_cannot_be_entered_is_another_component(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    grid = NavigationGrid.from_scene(make_room(walls=[(0.0, 0.0, 1.95, 6.0, 2.5, 2.05)]), renderer)
    assert grid.labels.max() == 2
    assert (grid.labels == 1).sum() > (grid.labels == 2).sum() > 0
    assert stands(grid, 3.0, 4.0)
    assert not stands(grid, 3.0, 1.0)


def test_cells_and_positions_are_inverse(divided_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(divided_room, renderer)
    rows, cols = np.nonzero(grid.navigable)
    again_rows, again_cols = grid.cells(grid.positions(rows, cols))
    np.testing.assert_array_equal(again_rows, rows)
    np.testing.assert_array_equal(again_cols, cols)


def test_random_positions_are_navigable_and_spread(divided_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(divided_room, renderer)
    positions = grid.random_navigable(np.random.default_rng(0), 500)
    assert grid.is_navigable(positions).all()
    assert 0.3 < (positions[:, 2] < 3.0).mean() < 0.8
    np.testing.assert_array_equal(positions, grid.random_navigable(np.random.default_rng(0), 500))


def test_positions_outside_are_not_navigable(empty_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(empty_room, renderer)
    assert not grid.is_navigable(np.array([[-5.0, 0.0, 3.0], [3.0, 0.0, 50.0]])).any()


def test_a_scene_without_floor_is_refused(empty_room: Scene, renderer: Renderer) -> None:
    with pytest.raises(SceneError, match=r"'room' has 0\.00 m2 of navigable floor at height 1\.20 m"):
        NavigationGrid.from_scene(empty_room, renderer, floor_height=1.2)


def test_lengths_must_be_positive(empty_room: Scene, renderer: Renderer) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        NavigationGrid.from_scene(empty_room, renderer, cell=0.0)
