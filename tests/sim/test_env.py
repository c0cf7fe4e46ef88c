"""The single env: Gymnasium's own checks, and the same life as a row of the vector env."""

import subprocess
import sys
from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import VectorEnv

from thinknav_sim.env import ENV_ID, ObjectNavEnv
from thinknav_sim.episodes import Episode, make_episodes
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

SMALL = ObjectNavConfig(width=16, height=16, max_steps=6)


@pytest.fixture(scope="module")
def episodes(divided_room: Scene, renderer: Renderer) -> tuple[Episode, ...]:
    return make_episodes(divided_room, NavigationGrid.from_scene(divided_room, renderer), 6, seed=0, renderer=renderer)


@pytest.fixture
def env(divided_room: Scene, episodes: tuple[Episode, ...]) -> Iterator[ObjectNavEnv]:
    made = ObjectNavEnv([divided_room], episodes, SMALL, order="sequential", render_mode="rgb_array")
    yield made
    made.close()


def test_gymnasiums_checker_is_content(env: ObjectNavEnv) -> None:
    check_env(env, skip_render_check=True)


def test_it_is_registered_with_a_default_home() -> None:
    env = gymnasium.make(ENV_ID, config=SMALL)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation["rgb"].std() > 5, "a home is more than one colour"
    env.close()


def test_the_vector_env_is_registered_too(divided_room: Scene, episodes: tuple[Episode, ...]) -> None:
    envs = gymnasium.make_vec(ENV_ID, num_envs=3, scenes=[divided_room], episodes=episodes, config=SMALL)
    assert isinstance(envs, VectorEnv)
    assert isinstance(envs.unwrapped, ObjectNavVectorEnv)
    observations, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observations)
    envs.close()


def test_single_envs_live_as_rows_of_the_vector_env(divided_room: Scene, episodes: tuple[Episode, ...]) -> None:
    together = ObjectNavVectorEnv([divided_room], episodes, len(episodes), SMALL, order="sequential")
    singles = {i: ObjectNavEnv([divided_room], [episode], SMALL) for i, episode in enumerate(episodes)}
    observations, _ = together.reset()
    for i, single in singles.items():
        for name, values in single.reset()[0].items():
            np.testing.assert_array_equal(values, observations[name][i])
    actions = np.random.default_rng(0).integers(1, 4, (SMALL.max_steps, len(episodes)))
    actions[3, 0] = Action.STOP
    for row in actions:
        observations, rewards, terminations, truncations, infos = together.step(row)
        for i, single in list(singles.items()):
            observation, reward, terminated, truncated, info = single.step(row[i])
            last = infos["final_obs"][i]
            for name, values in observation.items():
                expected = observations[name][i] if last is None else last[name]
                np.testing.assert_array_equal(values, expected)
            assert (reward, terminated, truncated) == (rewards[i], terminations[i], truncations[i])
            assert info["distance_to_goal"] == infos["distance_to_goal"][i]
            if terminated or truncated:
                assert info["episode"]["steps"] == infos["episode"]["steps"][i]
                singles.pop(i).close()
    assert not singles, "every episode has ended"
    together.close()


def test_no_episode_is_passed_over(env: ObjectNavEnv) -> None:
    played = []
    for _ in range(7):
        played.append(env.reset()[1]["episode_index"])
        env.step(Action.STOP)
    assert played == [0, 1, 2, 3, 4, 5, 0]
    assert env.reset(seed=3)[1]["episode_index"] == 0


def test_gymnasiums_statistics_take_a_key_of_their_own(env: ObjectNavEnv) -> None:
    recorded = gymnasium.wrappers.RecordEpisodeStatistics(env, stats_key="stats")
    recorded.reset()
    recorded.step(np.int64(Action.TURN_LEFT))
    info = recorded.step(np.int64(Action.STOP))[4]
    assert info["stats"]["l"] == info["episode"]["steps"] == 2


def test_gymnasiums_statistics_of_many_take_a_key_of_their_own(
    divided_room: Scene, episodes: tuple[Episode, ...]
) -> None:
    envs = ObjectNavVectorEnv([divided_room], episodes, 2, SMALL)
    recorded = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs, stats_key="stats")
    recorded.reset()
    recorded.step(np.array([Action.TURN_LEFT, Action.TURN_LEFT]))
    infos = recorded.step(np.array([Action.STOP, Action.TURN_LEFT]))[4]
    assert infos["_stats"].tolist() == infos["_episode"].tolist() == [True, False]
    assert infos["stats"]["l"][0] == infos["episode"]["steps"][0] == 2
    envs.close()


def test_an_ended_episode_must_be_reset(env: ObjectNavEnv) -> None:
    with pytest.raises(ResetNeeded):
        env.step(Action.TURN_LEFT)
    env.reset()
    assert "episode" in env.step(Action.STOP)[4]
    with pytest.raises(ResetNeeded):
        env.step(Action.TURN_LEFT)


def test_render_gives_what_the_agent_sees(
    env: ObjectNavEnv, divided_room: Scene, episodes: tuple[Episode, ...]
) -> None:
    observation, _ = env.reset()
    np.testing.assert_array_equal(env.render(), observation["rgb"])
    observation = env.step(Action.TURN_LEFT)[0]
    np.testing.assert_array_equal(env.render(), observation["rgb"])
    observation = env.step(Action.STOP)[0]
    np.testing.assert_array_equal(env.render(), observation["rgb"])
    observation, _ = env.reset()
    np.testing.assert_array_equal(env.render(), observation["rgb"])
    silent = ObjectNavEnv([divided_room], episodes, SMALL)
    silent.reset()
    assert silent.render() is None
    silent.close()


def test_the_simulator_does_without_torch() -> None:
    code = "import sys, thinknav_sim; sys.exit('torch' in sys.modules or 'open3d' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
