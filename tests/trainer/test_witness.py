"""What the witness says of episodes in a room with one chair."""

import math

import numpy as np
import pytest

from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.failures import Cause
from thinknav_trainer.scenes import Homes
from thinknav_trainer.witness import Witness, in_frame

STOP, FORWARD, LEFT, RIGHT, THINK = Action


@pytest.fixture
def env(homes: Homes) -> ObjectNavVectorEnv:
    return ObjectNavVectorEnv(homes.scenes, homes.train[:3], 1, ObjectNavConfig(width=8, height=8), order="sequential")


def test_pictures_reach_as_far_as_their_camera() -> None:
    config = ObjectNavConfig(width=20, height=10, hfov=90.0, max_depth=5.0)
    points = np.array(
        [[0, 0, -1], [0, 0, 1], [-0.9, 0, -1], [-1.1, 0, -1], [0, 0.4, -1], [0, 0.6, -1], [0, 0, -4.9], [0, 0, -5.1]]
    )
    ahead = in_frame(np.zeros((1, 3)), np.zeros(1), points, config)
    assert ahead.tolist() == [[True, False, True, False, True, False, True, False]]
    turned = in_frame(np.zeros((1, 3)), np.array([math.pi]), points[:2], config)
    assert turned.tolist() == [[False, True]]
    left = in_frame(np.zeros((1, 3)), np.array([math.pi / 2]), np.array([[-1.0, 0, 0], [1.0, 0, 0]]), config)
    assert left.tolist() == [[True, False]]


def play_shortest(env: ObjectNavVectorEnv) -> tuple[list[list[float]], list[int]]:
    from thinknav_sim.follower import ShortestPathFollower

    follower = ShortestPathFollower(env)
    env.reset()
    path, actions, done = [], [], False
    while not done:
        path.append(env.poses[0].tolist())
        actions.append(int(follower.actions()[0]))
        done = bool(env.step(actions[-1:])[2][0])
    return path, actions


def test_a_success_counts_by_both_rules_and_took_as_long_as_needed(env: ObjectNavVectorEnv) -> None:
    path, actions = play_shortest(env)
    told = Witness(env).testify(0, path, actions, success=True)
    assert (told.success_paper, told.success_viewpoint, told.failure) == (1, 1, None)
    assert told.steps_needed == len(actions)
    assert told.first_seen is not None
    assert 0 <= told.first_seen < len(actions)


def test_facing_away_counts_by_habitats_rule_alone(env: ObjectNavVectorEnv) -> None:
    path, actions = play_shortest(env)
    x, y, z, heading = path[-1]
    away = [*path[:-1], [x, y, z, heading + math.pi]]
    told = Witness(env).testify(0, away, actions, success=False)
    assert (told.success_paper, told.success_viewpoint) == (0, 1)
    assert told.failure == Cause.STOPPED_NOT_FACING


def test_stopping_at_once_is_too_far_and_running_out_is_no_success(env: ObjectNavVectorEnv) -> None:
    path, _ = play_shortest(env)
    witness = Witness(env)
    told = witness.testify(0, path[:1], [STOP], success=False)
    assert (told.success_paper, told.success_viewpoint, told.failure) == (0, 0, Cause.STOPPED_TOO_FAR)
    told = witness.testify(0, path, [FORWARD] * len(path), success=False)
    assert (told.success_paper, told.success_viewpoint) == (0, 0)
    assert told.failure == Cause.OUT_OF_STEPS
    x, y, z, heading = path[-1]
    told = witness.testify(0, [[x, y, z, heading + math.pi]], [LEFT], success=False)
    assert (told.first_seen, told.failure) == (None, Cause.NEVER_SAW)
