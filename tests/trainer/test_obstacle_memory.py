"""The sensor that remembers what was in the way."""

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.evaluate import evaluate
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.obstacle_memory import ObstacleMemory
from thinknav_trainer.policy import Policy
from thinknav_trainer.scenes import Homes
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.train import observation_shape

CONFIG = ObjectNavConfig(width=32, height=32)
AHEAD = [1.0, 0.0, 1.0]
FORWARD, LEFT, THINK = (np.array([action]) for action in (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.THINK))
ONE = np.zeros(1, np.int64)


def seen(moved: float, count: int = 1) -> Observations:
    """Nothing in sight, after a step of so many metres."""
    return {
        "depth": np.ones((count, 32, 32, 1), np.float32),
        "gps": np.zeros((count, 2), np.float32),
        "compass": np.zeros((count, 1), np.float32),
        "moved": np.full((count, 1), moved, np.float32),
    }


def shown(memory: ObstacleMemory, action: NDArray[np.int64], moved: float) -> list[float]:
    observations = seen(moved)
    memory.show(ONE, action, observations, {})
    return [float(value) for value in observations["free"][0]]


def test_what_it_ran_into_is_remembered_and_nothing_else() -> None:
    memory = ObstacleMemory(1, CONFIG)
    first = seen(0.0)
    memory.reset(first)
    assert first["free"].dtype == np.float32
    assert first["free"].tolist() == [AHEAD]
    # A step that leads on, and those that are not meant to, are no obstacle.
    assert shown(memory, FORWARD, 0.25) == shown(memory, LEFT, 0.0) == shown(memory, THINK, 0.0) == AHEAD
    blocked = shown(memory, FORWARD, 0.01)
    turns = round(np.degrees(np.arctan2(blocked[1], blocked[0])) / CONFIG.turn_angle)
    assert turns != 0
    assert blocked == pytest.approx([np.cos(np.radians(10 * turns)), np.sin(np.radians(10 * turns)), 1])
    assert shown(memory, LEFT, 0.0) == blocked
    memory.reset(first)
    assert first["free"].tolist() == [AHEAD]


def test_no_way_at_all_is_zeros() -> None:
    memory = ObstacleMemory(1, CONFIG)
    for turn in range(36):
        around = seen(0.0)
        around["compass"][:] = np.radians(10 * turn)
        memory.show(ONE, FORWARD, around, {})
    assert around["free"].tolist() == [[0, 0, 0]]


def test_an_episode_that_ends_keeps_its_sensor_and_the_next_begins_without() -> None:
    memory = ObstacleMemory(2, CONFIG)
    memory.reset(seen(0.0, 2))
    final = {name: values[0] for name, values in seen(0.01).items()}
    both = seen(0.0, 2)
    memory.show(np.array([0, 1]), np.array([Action.MOVE_FORWARD, Action.MOVE_FORWARD]), both, {0: final})
    assert final["free"][1] != 0
    assert both["free"][0].tolist() == AHEAD
    assert both["free"][1].tolist() == final["free"].tolist()


def test_it_goes_on_from_a_state() -> None:
    memory, other = ObstacleMemory(1, CONFIG), ObstacleMemory(1, CONFIG)
    blocked = shown(memory, FORWARD, 0.0)
    shown(other, FORWARD, 0.0)
    other.load_state_dict(ObstacleMemory(1, CONFIG).state_dict())
    assert shown(other, LEFT, 0.0) == AHEAD
    other.load_state_dict(memory.state_dict())
    assert shown(other, LEFT, 0.0) == blocked != AHEAD


def test_in_a_home_who_ran_into_something_is_told_another_way(smoke: TrainConfig, homes: Homes) -> None:
    vector_env = ObjectNavVectorEnv(homes.scenes, homes.train, 8, smoke.task, seed=1)
    think = smoke.think.model_copy(update={"strategy": "never"})
    env = ThinkingEnv(vector_env, think, None, memory=ObstacleMemory(8, smoke.task))
    assert env.reset()["free"].shape == (8, 3)
    stood = 0
    for _ in range(15):
        step = env.step(np.full(8, Action.MOVE_FORWARD))
        blocked = (step.observations["moved"][:, 0] < 0.05) & ~(step.terminated | step.truncated)
        assert (step.observations["free"][blocked] != AHEAD).any(axis=1).all()
        stood += int(blocked.sum())
    assert stood


def test_a_policy_has_it_in_evaluation_too(smoke: TrainConfig, homes: Homes) -> None:
    config = change_config(smoke, overrides=["think.strategy=never", "policy.obstacle_memory=true"])
    policy = Policy(observation_shape(config, None), config.network)
    records = evaluate(policy, config, homes.scenes, homes.held_out, None, Interruption())
    assert len(records) == len(homes.held_out)
    without = change_config(config, overrides=["policy.obstacle_memory=false"])
    with pytest.raises(KeyError, match="free"):
        evaluate(policy, without, homes.scenes, homes.held_out, None, Interruption())
