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


MASK = np.ones((6, 8), np.bool_)
ORIGIN = np.array([10.0, -2.0])


def test_a_mask_is_taken_as_it_is() -> None:
    mask = MASK.copy()
    mask[2, 3] = False
    grid = NavigationGrid.from_mask("home", mask, ORIGIN, 0.1, floor_height=0.5)
    np.testing.assert_array_equal(grid.navigable, mask)
    assert grid.positions(np.array([1]), np.array([4])).tolist() == pytest.approx(np.array([[10.45, 0.5, -1.85]]))


def test_refining_keeps_the_area_and_cuts_the_stairs() -> None:
    mask = np.tri(20, dtype=np.bool_)
    fine = NavigationGrid.from_mask("home", mask, ORIGIN, 0.1, refine=4)
    assert (fine.cell, fine.shape) == (0.025, (80, 80))
    rows, cols = np.nonzero(fine.navigable)
    # The rim of a staircase between the centres of its cells is the straight line that they lie on.
    inner = (rows >= 4) & (cols < 76)
    assert (cols - rows)[inner].max() == 2
    stairs = NavigationGrid.from_mask("home", np.kron(mask, np.ones((4, 4), np.bool_)), ORIGIN, 0.025)
    assert (stairs.navigable & (np.indices((80, 80))[1] - np.indices((80, 80))[0] == 3)).any()
    assert fine.navigable.mean() == pytest.approx(mask.mean(), abs=0.04)


def test_widening_keeps_clear_of_the_rim() -> None:
    widened = NavigationGrid.from_mask("home", MASK, ORIGIN, 0.1, widen=0.15)
    expected = np.zeros_like(MASK)
    expected[1:-1, 1:-1] = True
    np.testing.assert_array_equal(widened.navigable, expected)


@pytest.mark.parametrize(
    ("mask", "arguments", "error", "complaint"),
    [
        (~MASK, {}, SceneError, "'home': no cell of the mask is navigable"),
        (MASK, {"widen": 1.0}, SceneError, "with 1.0 m kept clear"),
        (MASK.astype(np.uint8), {}, ValueError, "bool of two axes, not uint8"),
        (MASK[0], {}, ValueError, r"not bool of shape \(8,\)"),
        (MASK, {"refine": 0}, ValueError, "refine 0 at least 1"),
    ],
)
def test_a_mask_that_makes_no_grid(mask, arguments, error, complaint: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(error, match=complaint):
        NavigationGrid.from_mask("home", mask, ORIGIN, 0.1, **arguments)


def test_snapping_moves_what_is_off_to_the_nearest_cell() -> None:
    mask = MASK.copy()
    mask[:, :4] = False
    grid = NavigationGrid.from_mask("home", mask, ORIGIN, 0.1, floor_height=0.5)
    places = np.array([[10.47, 0.2, -1.85], [10.37, 0.2, -1.85], [9.0, 0.2, -1.85]])
    snapped, moved = grid.snap(places)
    np.testing.assert_allclose(snapped, [places[0], [10.45, 0.5, -1.85], [10.45, 0.5, -1.85]])
    np.testing.assert_allclose(moved, [0.0, 0.08, 1.45])
