"""Frontier exploration: what its detector tells, how it plans on its map, and whole episodes in homes never seen."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.task_config import ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.agents.detector import CategoryDetector
from thinknav_trainer.agents.ways import Floor
from thinknav_trainer.config import TrainConfig, load_config
from thinknav_trainer.evaluate_agent import Setting, evaluate_agent
from thinknav_trainer.home_sets import parse_home_set
from thinknav_trainer.obstacle_kernels import BLOCKED, FREE
from thinknav_trainer.occupancy import OccupancyMap, ahead_of
from thinknav_trainer.scenes import Homes

START = np.zeros(4)
CLEARANCE = 0.2


def room(*walls: tuple[float, float, float, float]) -> OccupancyMap:
    """A closed free room of 4 x 4 m around the start, and walls in it: x from, x to, z from, z to."""
    known = OccupancyMap(ObjectNavConfig())
    paint(known, BLOCKED, -2.1, 2.1, -2.1, 2.1)
    paint(known, FREE, -2.0, 2.0, -2.0, 2.0)
    for wall in walls:
        paint(known, BLOCKED, *wall)
    return known


def paint(known: OccupancyMap, state: int, x0: float, x1: float, z0: float, z1: float) -> None:
    (row0, row1), (col0, col1) = known.cells(np.array([[x0, z0], [x1, z1]]) + 1e-6)
    known.state[row0:row1, col0:col1] = state


def at(known: OccupancyMap, x: float, z: float) -> NDArray[np.float64]:
    return np.array([x, 0.0, z, 0.0])


def test_a_room_that_is_wholly_known_has_no_rim() -> None:
    known = room()
    floor = Floor(known, START, CLEARANCE)
    assert not floor.rims(np.zeros(known.state.shape, np.bool_)).any()


def test_a_doorway_into_the_unknown_is_a_rim_until_it_was_looked_at() -> None:
    known = room()
    paint(known, FREE, -0.4, 0.4, -2.1, -2.0)
    floor = Floor(known, START, CLEARANCE)
    looked = np.zeros(known.state.shape, np.bool_)
    way = floor.way(floor.rims(looked), to_goal=False)
    assert way.left(START) == pytest.approx(2.05, abs=0.1)
    looked[known.near(at(known, 0.0, -1.8), 0.6)] = True
    assert not floor.rims(looked).any()


def test_a_gap_too_narrow_for_the_body_leads_nowhere() -> None:
    known = room()
    paint(known, FREE, -0.15, 0.15, -2.1, -2.0)
    assert not Floor(known, START, CLEARANCE).rims(np.zeros(known.state.shape, np.bool_)).any()


def test_the_nearest_rim_is_the_nearest_to_walk() -> None:
    """A door right behind a wall is farther than one across the room."""
    known = room((-2.0, 1.4, -1.0, -0.9))
    paint(known, FREE, -1.4, -0.6, -2.1, -2.0)  # behind the wall
    paint(known, FREE, -2.1, -2.0, 0.6, 1.4)
    floor = Floor(known, at(known, -1.0, -0.6), CLEARANCE)
    way = floor.way(floor.rims(np.zeros(known.state.shape, np.bool_)), to_goal=False)
    assert way.left(at(known, -1.0, -0.6)) == pytest.approx(math.hypot(1.0, 1.3), abs=0.25)
    assert way.left(at(known, -1.0, -1.4)) == pytest.approx(0.65, abs=0.15)


def test_it_stands_before_the_goal_on_its_own_side_of_a_wall() -> None:
    known = room((-2.0, 2.0, -1.0, -0.9))
    goal = np.zeros(known.state.shape, np.bool_)
    goal[known.cells(np.array([0.0, -0.95]))] = True
    floor = Floor(known, START, CLEARANCE)
    targets = floor.before(goal, 0.7)
    assert targets.any()
    rows, _ = np.nonzero(targets)
    wall, _ = known.cells(np.array([0.0, -0.9]))
    assert rows.min() + floor.part[0].start > wall
    assert not floor.before(goal, 0.15).any()


def test_the_detector_sees_the_goal_where_it_stands(smoke: TrainConfig, homes: Homes) -> None:
    """Whatever is detected lies in the box of an object of the category; looking around from some places finds it."""
    config = smoke.env.model_copy(update={"width": 64, "height": 64})
    env = ObjectNavVectorEnv(homes.scenes, homes.train[:8], 8, config, order="sequential")
    detector = CategoryDetector(env)
    observations, _ = env.reset()
    seen = 0
    for _ in range(36):
        detected = detector.detect(observations["depth"])
        for pose, episode, found in zip(env.poses, env.episodes, detected, strict=True):
            places = ahead_of(pose, found[:, 0], found[:, 1])
            boxes = [thing.box for thing in homes.scenes[0].objects_of(episode.object_category)]
            inside = [
                ((places >= box.low[[0, 2]] - 0.05) & (places <= box.high[[0, 2]] + 0.05)).all(axis=1) for box in boxes
            ]
            assert np.any(inside, axis=0).all()
            seen += len(found) > 0
        observations, *_ = env.step(np.full(8, 2))
    env.close()
    assert 8 < seen < 8 * 36


def test_it_finds_most_goals_of_homes_that_it_has_never_seen() -> None:
    config = load_config("cpu", overrides=["num_envs=4"])
    _, records = evaluate_agent("frontier", parse_home_set("val:0-2"), 4, Setting(config))
    assert sum(record.measures["success"] for record in records) >= 3
