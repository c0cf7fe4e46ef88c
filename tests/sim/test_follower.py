"""The agent that knows the map finds what there is to find, so that episodes and success zones are sound."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from thinknav_sim.episodes import Episode, make_episodes
from thinknav_sim.follower import ShortestPathFollower
from thinknav_sim.homes import generate_home
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

TINY = ObjectNavConfig(width=2, height=2)


def play(scenes: list[Scene], episodes: list[Episode], config: ObjectNavConfig) -> dict[str, list[float]]:
    """Play every episode once, each in an env of its own; returns the summaries' columns."""
    env = ObjectNavVectorEnv(scenes, episodes, len(episodes), config, order="sequential")
    follower = ShortestPathFollower(env)
    env.reset()
    playing = np.arange(len(episodes))
    columns: dict[str, list[float]] = {}
    while playing.size:
        infos = env.step_subset(playing, follower.actions(playing))[4]
        for name, values in infos["episode"].items():
            columns.setdefault(name, []).extend(values[infos["_episode"]].tolist())
        playing = playing[~infos["_episode"]]
    env.close()
    return columns


@pytest.mark.parametrize("rule", ["paper", "viewpoint"])
@pytest.mark.parametrize("sliding", [False, True])
def test_it_finds_its_goals_around_a_wall(
    divided_room: Scene, renderer: Renderer, rule: Literal["paper", "viewpoint"], sliding: bool
) -> None:
    config = TINY.model_copy(update={"success": rule, "allow_sliding": sliding})
    grid = NavigationGrid.from_scene(divided_room, renderer)
    result = play([divided_room], list(make_episodes(divided_room, grid, 12, 0, renderer=renderer)), config)
    assert np.mean(result["success"]) == 1.0
    assert np.mean(result["spl"]) > 0.93
    assert not any(result["timed_out"])


def test_it_finds_nearly_everything_in_homes(renderer: Renderer) -> None:
    homes: list[Scene] = []
    episodes: list[Episode] = []
    for seed in range(4):
        home = generate_home(seed)
        homes.append(home)
        episodes += make_episodes(home, NavigationGrid.from_scene(home, renderer), 24, 0, renderer=renderer)
    result = play(homes, episodes, TINY)
    assert np.mean(result["success"]) >= 0.95
    assert np.mean(result["spl"]) >= 0.85


def test_it_knows_how_many_steps_it_needs(divided_room: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(divided_room, renderer)
    episodes = list(make_episodes(divided_room, grid, 6, 0, renderer=renderer))
    env = ObjectNavVectorEnv([divided_room], episodes, 6, TINY, order="sequential")
    follower = ShortestPathFollower(env)
    needed = [follower.steps_needed(index) for index in range(6)]
    env.close()
    assert play([divided_room], episodes, TINY)["steps"] == sorted(needed)  # who is there first is summed up first
    hurried = ObjectNavVectorEnv([divided_room], episodes, 1, TINY.model_copy(update={"max_steps": 3}))
    assert ShortestPathFollower(hurried).steps_needed(0) == 3
    hurried.close()


def test_it_turns_the_short_way_and_stops(divided_room: Scene) -> None:
    beside = Episode("beside", "divided", (1.25, 0.0, 2.0), math.radians(90), "chair", 0.0, 0.0)
    episodes = [beside, replace(beside, start_heading=math.radians(-90)), replace(beside, start_heading=0.0)]
    env = ObjectNavVectorEnv([divided_room], episodes, 3, TINY, order="sequential")
    env.reset()
    # The chair lies at heading 0.
    actions = ShortestPathFollower(env).actions()
    assert actions.tolist() == [Action.TURN_RIGHT, Action.TURN_LEFT, Action.STOP]
    env.close()
