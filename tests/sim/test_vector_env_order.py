"""Whatever the order in which envs are stepped, saved or loaded, each lives the same life."""

import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode, make_episodes
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

NUM_ENVS = 3
LENGTH = 12
CONFIG = ObjectNavConfig(width=8, height=8, max_steps=5, think_action=True)


@pytest.fixture(scope="module")
def episodes(divided_room: Scene, renderer: Renderer) -> tuple[Episode, ...]:
    grid = NavigationGrid.from_scene(divided_room, renderer)
    return make_episodes(divided_room, grid, 12, seed=0, renderer=renderer)


@pytest.fixture(scope="module")
def env(divided_room: Scene, episodes: tuple[Episode, ...]) -> Iterator[ObjectNavVectorEnv]:
    made = ObjectNavVectorEnv([divided_room], episodes, NUM_ENVS, CONFIG)
    yield made
    made.close()


def rows(result: tuple[Any, ...]) -> list[list[NDArray[Any]]]:
    """One list of arrays for each env of a step's result."""
    observations, rewards, terminations, truncations, infos = result
    columns = [*observations.values(), rewards, terminations, truncations, infos["distance_to_goal"]]
    columns += [infos["episode_index"], infos["_episode"], *infos["episode"].values(), *infos["reward_terms"].values()]
    last = [() if final is None else tuple(final.values()) for final in infos["final_obs"]]
    return [[column[i] for column in columns] + list(last[i]) for i in range(len(rewards))]


def assert_same(life: list[list[NDArray[Any]]], other: list[list[NDArray[Any]]]) -> None:
    assert len(life) == len(other)
    for moment, other_moment in zip(life, other, strict=True):
        for value, other_value in zip(moment, other_moment, strict=True):
            np.testing.assert_array_equal(value, other_value)


def live_together(env: ObjectNavVectorEnv, seed: int, actions: NDArray[np.int64]) -> list[list[list[NDArray[Any]]]]:
    env.reset(seed=seed)
    steps = [rows(env.step(row)) for row in actions.T]
    return [[step[i] for step in steps] for i in range(NUM_ENVS)]


ACTIONS = st.lists(st.integers(0, 4), min_size=LENGTH, max_size=LENGTH)


@settings(deadline=None, max_examples=40)
@given(
    actions=st.lists(ACTIONS, min_size=NUM_ENVS, max_size=NUM_ENVS).map(lambda lists: np.array(lists, np.int64)),
    seed=st.integers(0, 100),
    data=st.data(),
)
def test_any_interleaving_is_the_same_life(
    env: ObjectNavVectorEnv, actions: NDArray[np.int64], seed: int, data: st.DataObject
) -> None:
    together = live_together(env, seed, actions)
    env.reset(seed=seed)
    apart: list[list[list[NDArray[Any]]]] = [[] for _ in range(NUM_ENVS)]
    while any(len(life) < LENGTH for life in apart):
        waiting = [i for i in range(NUM_ENVS) if len(apart[i]) < LENGTH]
        chosen = data.draw(st.lists(st.sampled_from(waiting), min_size=1, unique=True))
        result = env.step_subset(chosen, [actions[i, len(apart[i])] for i in chosen])
        for i, row in zip(chosen, rows(result), strict=True):
            apart[i].append(row)
    for life, other in zip(together, apart, strict=True):
        assert_same(life, other)


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 100), split=st.integers(0, LENGTH))
def test_a_saved_state_goes_on_as_it_would_have(
    divided_room: Scene, episodes: tuple[Episode, ...], env: ObjectNavVectorEnv, seed: int, split: int
) -> None:
    actions = np.random.default_rng(seed).integers(0, 5, (NUM_ENVS, LENGTH))
    together = live_together(env, seed, actions)
    env.reset(seed=seed)
    for row in actions.T[:split]:
        env.step(row)
    saved = pickle.dumps(env.state_dict())
    here = env.observations()
    other = ObjectNavVectorEnv([divided_room], episodes, NUM_ENVS, CONFIG, seed=999)
    other.load_state_dict(pickle.loads(saved))
    for name, values in other.observations().items():
        np.testing.assert_array_equal(values, here[name])
    rest = [rows(other.step(row)) for row in actions.T[split:]]
    other.close()
    for i in range(NUM_ENVS):
        assert_same(together[i][split:], [step[i] for step in rest])


def test_the_same_seed_is_the_same_life_in_another_env(
    divided_room: Scene, episodes: tuple[Episode, ...], env: ObjectNavVectorEnv
) -> None:
    actions = np.random.default_rng(0).integers(0, 5, (NUM_ENVS, LENGTH))
    other = ObjectNavVectorEnv([divided_room], episodes, NUM_ENVS, CONFIG)
    for life, again in zip(live_together(env, 5, actions), live_together(other, 5, actions), strict=True):
        assert_same(life, again)
    other.close()


def test_more_envs_do_not_change_the_first(
    divided_room: Scene, episodes: tuple[Episode, ...], env: ObjectNavVectorEnv
) -> None:
    actions = np.random.default_rng(0).integers(0, 5, (NUM_ENVS, LENGTH))
    alone = ObjectNavVectorEnv([divided_room], episodes, 1, CONFIG)
    alone.reset(seed=5)
    life = [rows(alone.step(actions[:1, k]))[0] for k in range(LENGTH)]
    assert_same(live_together(env, 5, actions)[0], life)
    alone.close()
