"""Our navigation against Habitat-Sim's, on its own grid of a real home and 1,000 real episodes with expert actions."""

import math
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.habitat import HabitatEpisode, HabitatFile, heading_of, read_file
from thinknav_sim.navigation import GridTable, NavigationGrid, distance_field, distances_at
from thinknav_sim.navigation.kinematics import walk

SCENE = "17DRP5sb8fy"
CELL = 0.1
# The grid was made for a body of 0.1 m radius, Habitat-Sim's default; ObjectNav's agent has 0.18 m.
WIDEN = 0.08
FORWARD, LEFT, RIGHT = 1, 2, 3
TURN = math.radians(30)


@pytest.fixture(scope="module")
def file(real_data: Path) -> HabitatFile:
    return read_file(real_data / "mp3d_17DRP5sb8fy" / f"{SCENE}_1000.json.gz")


@pytest.fixture(scope="module")
def mask(real_data: Path) -> NDArray[np.bool_]:
    loaded: NDArray[np.bool_] = np.load(real_data / "mp3d_17DRP5sb8fy" / f"{SCENE}_topdown_binary.npy")
    return loaded


def info(file: HabitatFile, key: str) -> NDArray[np.float64]:
    return np.array([(episode.info or {})[key] for episode in file.episodes], np.float64)


def outer_corner(file: HabitatFile) -> NDArray[np.float64]:
    """Habitat-Sim looks at the low corner of each cell; that point is the centre of ours."""
    low: NDArray[np.float64] = info(file, "navigation_bounds")[0, 0, [0, 2]]
    return low - CELL / 2


@pytest.fixture(scope="module")
def grid(file: HabitatFile, mask: NDArray[np.bool_]) -> NavigationGrid:
    """The home as ObjectNav's agent can walk it."""
    return NavigationGrid.from_mask(SCENE, mask, outer_corner(file), CELL, refine=2, widen=WIDEN)


@pytest.fixture(scope="module")
def starts(file: HabitatFile, grid: NavigationGrid) -> NDArray[np.float64]:
    return grid.snap(np.array([episode.start_position for episode in file.episodes]))[0]


def test_starts_and_viewpoints_are_navigable_within_a_cell(
    file: HabitatFile, mask: NDArray[np.bool_], grid: NavigationGrid
) -> None:
    as_given = NavigationGrid.from_mask(SCENE, mask, outer_corner(file), CELL)
    starts = np.array([episode.start_position for episode in file.episodes])
    viewpoints = info(file, "best_viewpoint_position")
    assert len(starts) == 1000
    for places in (starts, viewpoints):
        for home in (as_given, grid):
            assert (home.snap(places)[1] <= CELL).all()
        assert as_given.is_navigable(places).mean() >= 0.999
        assert grid.is_navigable(places).mean() >= 0.99


def test_walking_distances_are_habitats(file: HabitatFile, grid: NavigationGrid, starts: NDArray[np.float64]) -> None:
    """To the nearest viewpoint of any goal of the category, which is Habitat's distance_to_goal."""
    by_category: defaultdict[str, list[int]] = defaultdict(list)
    for index, episode in enumerate(file.episodes):
        by_category[episode.object_category].append(index)
    walked = np.empty(len(starts))
    for indices in by_category.values():
        targets = np.zeros(grid.shape, np.bool_)
        targets[grid.cells(viewpoints_near(grid, file, file.episodes[indices[0]]))] = True
        walked[indices] = distances_at(grid, distance_field(grid, targets), starts[indices])
    ratio = walked / info(file, "geodesic_distance")
    low, median, high = np.percentile(ratio, [5, 50, 95])
    assert abs(median - 1) <= 0.01
    assert low >= 0.95
    assert high <= 1.05
    assert np.percentile(np.abs(ratio - 1), 99) <= 0.05


def viewpoints_near(grid: NavigationGrid, file: HabitatFile, episode: HabitatEpisode) -> NDArray[np.float64]:
    """(N, 3) viewpoints of an episode's goals, moved onto the grid; those a cell off are in rooms nobody gets to."""
    places = [view.agent_state.position for goal in file.goals_of(episode) for view in goal.view_points]
    snapped, moved = grid.snap(np.array(places))
    return snapped[moved <= CELL]


@pytest.mark.parametrize("sliding", [True, False])
def test_the_experts_actions_lead_to_the_viewpoint(
    file: HabitatFile, grid: NavigationGrid, starts: NDArray[np.float64], sliding: bool
) -> None:
    table = GridTable.of([grid])
    missed = []
    for episode, start, viewpoint in zip(file.episodes, starts, info(file, "best_viewpoint_position"), strict=True):
        x, z, heading = start[0], start[2], heading_of(episode.start_rotation)
        for action in episode.as_json()["shortest_paths"][0]:
            if action == FORWARD:
                x, z, _ = walk(table, 0, x, z, heading, 0.25, sliding)
            heading += {LEFT: TURN, RIGHT: -TURN}.get(action, 0.0)
        missed.append(math.hypot(x - viewpoint[0], z - viewpoint[2]))
    assert np.median(missed) <= 0.15


def test_turning_the_other_way_leads_elsewhere(file: HabitatFile, grid: NavigationGrid) -> None:
    """So that the test above can fail: with mirrored headings nobody arrives."""
    episode = file.episodes[0]
    table = GridTable.of([grid])
    (x, _, z), heading = episode.start_position, -heading_of(episode.start_rotation)
    for action in episode.as_json()["shortest_paths"][0]:
        if action == FORWARD:
            x, z, _ = walk(table, 0, x, z, heading, 0.25, True)
        heading -= {LEFT: TURN, RIGHT: -TURN}.get(action, 0.0)
    target = info(file, "best_viewpoint_position")[0]
    assert math.hypot(x - target[0], z - target[2]) > 1.0
