"""Who stands where it stood is not drawn again, and nobody can tell."""

import math
from unittest.mock import patch

import numpy as np
import pytest

from thinknav_sim.episodes import Episode
from thinknav_sim.render import Camera, make_renderer
from thinknav_sim.scene import Scene
from thinknav_sim.seen_views import SeenViews
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

EPISODES = [
    Episode("far", "divided", (4.5, 0.0, 1.25), math.pi / 2, "chair", 2.0, 2.0),
    Episode("bed", "divided", (4.0, 0.0, 2.0), math.pi / 2, "bed", 4.0, 2.0),
    Episode("at-chair", "divided", (1.25, 0.0, 2.0), 0.0, "chair", 0.0, 0.0),
]


def test_an_env_that_remembers_gives_what_one_that_forgets_gives(divided_room: Scene) -> None:
    config = ObjectNavConfig(width=16, height=12, think_action=True, max_steps=9)
    envs = [ObjectNavVectorEnv([divided_room], EPISODES, 3, config, seed=1) for _ in range(2)]
    remembering, forgetting = envs
    forgetting._seen = None
    rng = np.random.default_rng(0)
    for one, other in zip(remembering.reset()[0].items(), forgetting.reset()[0].items(), strict=True):
        np.testing.assert_array_equal(one[1], other[1])
    drawn = 0
    renderer = remembering.world.renderer
    for _ in range(150):
        agents = np.flatnonzero(rng.random(3) < 0.7)
        actions = rng.choice(len(Action), size=len(agents), p=[0.05, 0.25, 0.15, 0.15, 0.4])
        with patch.object(type(renderer), "render", autospec=True, side_effect=type(renderer).render) as render:
            step = remembering.step_subset(agents, actions)
        drawn += sum(len(call.args[1]) for call in render.call_args_list)
        expected = forgetting.step_subset(agents, actions)
        for name, values in step[0].items():
            np.testing.assert_array_equal(values, expected[0][name], err_msg=name)
        for mine, theirs in zip(step[4]["final_obs"], expected[4]["final_obs"], strict=True):
            assert (mine is None) == (theirs is None)
            for name in mine or ():
                np.testing.assert_array_equal(mine[name], theirs[name], err_msg=name)
    assert 0 < drawn < 0.8 * 150 * 3 * 0.7
    for env in envs:
        env.close()


def test_the_same_pose_in_another_scene_is_drawn(divided_room: Scene, empty_room: Scene) -> None:
    renderer = make_renderer("auto")
    camera = Camera(16, 12)
    scenes = [renderer.add_scene(divided_room), renderer.add_scene(empty_room)]
    views = SeenViews(camera, 2)
    pose, agent = np.array([[4.0, 0.0, 2.0, math.pi / 2]]), np.array([1])
    depths = [renderer.render(np.array([scene]), pose, camera)[1] for scene in scenes]
    assert not np.array_equal(depths[0], depths[1]), "the two rooms look the same from here"
    for scene in (scenes[0], scenes[1], scenes[0]):
        expected = renderer.render(np.array([scene]), pose, camera)
        for _ in range(2):
            for mine, theirs in zip(views.render(renderer, agent, np.array([scene]), pose), expected, strict=True):
                np.testing.assert_array_equal(mine, theirs)
    renderer.close()


@pytest.mark.parametrize("written_over", [0, 255])
def test_what_a_caller_does_to_its_pictures_is_its_own_affair(divided_room: Scene, written_over: int) -> None:
    config = ObjectNavConfig(width=16, height=12, think_action=True)
    env = ObjectNavVectorEnv([divided_room], EPISODES, 3, config, seed=1)
    seen = env.reset()[0]["rgb"]
    expected = seen.copy()
    for _ in range(2):
        seen[:] = written_over
        seen = env.step(np.full(3, Action.THINK))[0]["rgb"]
        np.testing.assert_array_equal(seen, expected)
    env.close()
