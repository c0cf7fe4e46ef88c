"""Where an agent asks: dots on the map, and situations."""

import math

import numpy as np
import pytest

from thinknav_sim.homes import generate_home
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import Action
from thinknav_trainer.records import MEASURES, EpisodeRecord
from thinknav_trainer.report.asks import FIRST_STEPS, asking_situations, doorway_places, draw_asks
from thinknav_trainer.report.floor_map import draw_floor_map

STOP, FORWARD, LEFT, RIGHT, THINK = Action


@pytest.fixture(scope="module")
def home() -> tuple[Scene, NavigationGrid]:
    scene = generate_home(3, rooms=2)
    return scene, NavigationGrid.from_scene(scene, make_renderer())


def record(path: list[list[float]], actions: list[Action], first_seen: int | None = None) -> EpisodeRecord:
    measures = dict.fromkeys(MEASURES, 0.0)
    return EpisodeRecord("e", "h", "bed", measures, {}, path, [int(a) for a in actions], [], first_seen, None)


def shares(records: list[EpisodeRecord], home: tuple[Scene, NavigationGrid]) -> dict[str, tuple[float, float]]:
    return {row.name: (row.steps, row.asks) for row in asking_situations(records, *home)}


def test_who_asks_only_at_a_doorway_is_found_out(home: tuple[Scene, NavigationGrid]) -> None:
    scene, grid = home
    doorways = doorway_places(scene, grid)
    assert len(doorways)
    x, z = doorways.mean(axis=0)
    places = grid.positions(*np.nonzero(grid.navigable))
    far = max(places.tolist(), key=lambda at: math.hypot(at[0] - x, at[2] - z))
    path = [[*far, 0.0]] * 30 + [[x, far[1], z, 0.0]] * 10
    actions = [LEFT] * 30 + [THINK] * 10
    assert shares([record(path, actions)], home)["within 0.5 m of a doorway"] == (0.25, 1.0)
    assert {row.name: row.ratio for row in asking_situations([record(path, actions)], *home)}[
        "within 0.5 m of a doorway"
    ] == 4.0


def test_situations_of_an_episode(home: tuple[Scene, NavigationGrid]) -> None:
    """Ten steps, half a circle, a think in it; then against something, twice, with a think after each."""
    turns = [[1.0, 0.0, 1.0, math.radians(10 * n)] for n in range(18)]
    path = [[1.0, 0.0, 1.0 + 0.25 * n, 0.0] for n in range(10)] + turns + [turns[-1]] * 4
    actions = [FORWARD] * 10 + [LEFT] * 17 + [THINK] + [FORWARD, THINK, FORWARD, THINK]
    found = shares([record(path, actions, first_seen=30)], home)
    assert found[f"the first {FIRST_STEPS} steps"] == pytest.approx((10 / 32, 0))
    assert found["just bumped into something"] == pytest.approx((3 / 32, 2 / 3))
    assert found["just turned back"] == pytest.approx((12 / 32, 1))
    assert found["the goal was in view before"] == pytest.approx((2 / 32, 1 / 3))


def test_who_never_asks_has_no_situations(home: tuple[Scene, NavigationGrid]) -> None:
    assert asking_situations([record([[0.0] * 4] * 3, [LEFT] * 3)], *home) == []


def test_dots_lie_where_it_asked_and_grow_with_the_asks(home: tuple[Scene, NavigationGrid]) -> None:
    scene, grid = home
    floor_map = draw_floor_map(scene, make_renderer(), grid, 0.18)
    places = grid.positions(*np.nonzero(grid.navigable))
    often, once = places[0], places[-1]
    path = [[*often, 0.0]] * 9 + [[*once, 0.0]] * 1
    changed = []
    for place in (often, once):
        drawn = np.asarray(draw_asks(floor_map, [record([[*place, 0.0]], [THINK])]))
        rows = np.argwhere((drawn != np.asarray(floor_map.image)).any(axis=2))
        column, row = floor_map.pixel(place[0], place[2])
        assert np.abs(rows.mean(axis=0) - [row, column]).max() < 1.5
        changed.append(len(rows))
    assert changed[0] == pytest.approx(changed[1], rel=0.1)  # alone, each is the commonest
    both = np.asarray(draw_asks(floor_map, [record([each], [THINK]) for each in path]))
    sizes = []
    for place in (often, once):
        column, row = (round(at) for at in floor_map.pixel(place[0], place[2]))
        around = (slice(max(0, row - 13), row + 14), slice(max(0, column - 13), column + 14))
        sizes.append((both[around] != np.asarray(floor_map.image)[around]).any(axis=2).sum())
    assert sizes[0] > 3 * sizes[1]
