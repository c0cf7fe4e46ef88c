"""The vector env's contract: spaces, rewards, endings, autoreset, subsets of envs, errors."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from tests.sim.conftest import MakeRoom
from thinknav_sim.episodes import Episode, EpisodeError
from thinknav_sim.follower import ShortestPathFollower
from thinknav_sim.scene import GOAL_CATEGORIES, Scene, SceneError
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

SMALL = ObjectNavConfig(width=16, height=12, think_action=True)
LEFT = math.pi / 2

# In front of the chair of `divided_room`, 0.5 m from it; across the room from it; beyond the wall.
AT_CHAIR = Episode("at-chair", "divided", (1.25, 0.0, 2.0), 0.0, "chair", 0.0, 0.0)
FAR = Episode("far", "divided", (4.5, 0.0, 1.25), LEFT, "chair", 2.0, 2.0)
BED = Episode("bed", "divided", (4.0, 0.0, 2.0), LEFT, "bed", 4.0, 2.0)

MakeEnv = Callable[..., ObjectNavVectorEnv]


@pytest.fixture
def make_env(divided_room: Scene) -> Iterator[MakeEnv]:
    made: list[ObjectNavVectorEnv] = []

    def make(
        *episodes: Episode, num_envs: int = 0, config: ObjectNavConfig = SMALL, **options: Any
    ) -> ObjectNavVectorEnv:
        options = {"order": "sequential", **options}
        made.append(ObjectNavVectorEnv([divided_room], episodes, num_envs or len(episodes), config, **options))
        return made[-1]

    yield make
    for env in made:
        env.close()


def test_observations_are_in_the_space(make_env: MakeEnv) -> None:
    env = make_env(FAR, BED, AT_CHAIR, num_envs=4)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    observations, _ = env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(20):
        assert env.observation_space.contains(observations)
        actions = env.action_space.sample()
        observations, rewards, terminations, truncations, _ = env.step(actions)
        assert rewards.dtype == np.float32
        assert rewards.shape == terminations.shape == truncations.shape == (4,)
        np.testing.assert_array_equal(terminations, actions == Action.STOP)


def test_arrays_are_fresh_each_step(make_env: MakeEnv) -> None:
    env = make_env(FAR, BED)
    before, _ = env.reset()
    kept = {name: values.copy() for name, values in before.items()}
    poses = env.poses
    after = env.step([Action.TURN_LEFT, Action.MOVE_FORWARD])[0]
    for name, values in before.items():
        np.testing.assert_array_equal(values, kept[name])
        assert not np.shares_memory(values, after[name])
    assert not np.array_equal(poses, env.poses)


def test_sensors_after_known_moves(make_env: MakeEnv) -> None:
    env = make_env(FAR)
    observations, _ = env.reset()
    np.testing.assert_allclose(observations["gps"], [[0.0, 0.0]])
    np.testing.assert_allclose(observations["compass"], [[0.0]])
    assert observations["objectgoal"].tolist() == [[GOAL_CATEGORIES.index("chair")]]
    # It faces -x. Just above the middle it sees the wall in 4.5 m, just below the chair, which is 0.8 m high, in 3 m.
    middle = observations["depth"][0, 5:7, 8, 0]
    np.testing.assert_allclose(middle, [(4.5 - 0.5) / 4.5, (3.0 - 0.5) / 4.5], atol=1e-4)
    for _ in range(2):
        observations = env.step([Action.MOVE_FORWARD])[0]
    np.testing.assert_allclose(observations["gps"], [[0.5, 0.0]], atol=1e-6)
    np.testing.assert_allclose(observations["moved"], [[0.25]], atol=1e-6)
    for _ in range(9):
        observations = env.step([Action.TURN_RIGHT])[0]
    np.testing.assert_allclose(observations["compass"], [[-math.pi / 2]], atol=1e-6)
    assert observations["moved"].tolist() == [[0.0]]
    observations = env.step([Action.MOVE_FORWARD])[0]
    # Turned right from -x it faces -z, which lies to the right of the start.
    np.testing.assert_allclose(observations["gps"], [[0.5, 0.25]], atol=1e-6)
    np.testing.assert_allclose(env.poses, [[4.0, 0.0, 1.0, 0.0]], atol=1e-6)


def test_rewards_are_the_sum_of_their_terms(make_env: MakeEnv) -> None:
    env = make_env(FAR)
    _, infos = env.reset()
    before = infos["distance_to_goal"][0]
    _, rewards, _, _, infos = env.step([Action.MOVE_FORWARD])
    terms = infos["reward_terms"]
    assert terms["slack"][0] == np.float32(-1e-3)
    assert terms["progress"][0] == pytest.approx(before - infos["distance_to_goal"][0])
    assert terms["progress"][0] == pytest.approx(0.25, abs=0.01)
    assert terms["success"][0] == 0.0
    assert rewards[0] == sum(terms.values())[0]


@pytest.mark.parametrize(("turns", "found"), [(0, True), (3, True), (9, False)])
def test_stopping_at_the_goal(make_env: MakeEnv, turns: int, found: bool) -> None:
    env = make_env(AT_CHAIR)
    env.reset()
    for _ in range(turns):
        env.step([Action.TURN_LEFT])
    _, rewards, terminations, truncations, infos = env.step([Action.STOP])
    assert terminations[0]
    assert not truncations[0]
    assert infos["_episode"][0]
    assert infos["episode"]["success"][0] == found
    assert rewards[0] == pytest.approx((2.5 if found else 0.0) - 1e-3)


def test_stopping_elsewhere_is_no_success(make_env: MakeEnv) -> None:
    env = make_env(FAR)
    env.reset()
    infos = env.step([Action.STOP])[4]
    assert not infos["episode"]["success"][0]
    assert infos["episode"]["spl"][0] == 0.0


def test_the_viewpoint_rule_does_not_ask_to_face_the_goal(make_env: MakeEnv) -> None:
    env = make_env(
        replace(AT_CHAIR, start_heading=math.pi), FAR, config=SMALL.model_copy(update={"success": "viewpoint"})
    )
    env.reset()
    assert env.step([Action.STOP] * 2)[4]["episode"]["success"].tolist() == [True, False]


def test_an_episode_is_cut_off_at_its_last_step(make_env: MakeEnv) -> None:
    env = make_env(FAR, config=SMALL.model_copy(update={"max_steps": 3}))
    env.reset()
    for step in (1, 2, 3):
        _, _, terminations, truncations, infos = env.step([Action.TURN_LEFT])
        assert truncations[0] == (step == 3)
        assert not terminations[0]
    assert infos["episode"]["timed_out"][0]
    assert infos["episode"]["steps"][0] == 3
    for _ in range(2):
        env.step([Action.TURN_LEFT])
    _, _, terminations, truncations, infos = env.step([Action.STOP])
    assert (terminations[0], truncations[0], infos["episode"]["timed_out"][0]) == (True, False, False)


def test_an_episode_is_summed_up(make_env: MakeEnv) -> None:
    env = make_env(FAR, BED, num_envs=1)
    _, infos = env.reset()
    shortest = infos["distance_to_goal"][0]
    actions = (
        [Action.THINK, Action.TURN_RIGHT, Action.TURN_LEFT, Action.THINK] + [Action.MOVE_FORWARD] * 12 + [Action.STOP]
    )
    for action in actions:
        *_, infos = env.step([action])
    summary = {name: values[0] for name, values in infos["episode"].items()}
    # The chair, 3 m ahead, stops it; it was in the zone before and had its way in a straight line.
    assert summary["success"]
    assert summary["steps"] == len(actions)
    assert summary["thinks"] == 2
    assert summary["collisions"] >= 1
    assert summary["shortest_path_length"] == pytest.approx(shortest)
    assert 2.7 < summary["path_length"] < 3.0
    assert summary["spl"] == pytest.approx(shortest / summary["path_length"])
    assert summary["soft_spl"] == pytest.approx(summary["spl"])
    assert summary["distance_to_goal"] == 0.0
    assert infos["episode_index"].tolist() == [0]
    assert env.episode_indices.tolist() == [1]


def test_thinking_moves_nothing(make_env: MakeEnv) -> None:
    env = make_env(FAR)
    before, _ = env.reset()
    after, rewards, _, _, infos = env.step([Action.THINK])
    for name, values in before.items():
        np.testing.assert_array_equal(values, after[name])
    assert rewards[0] == np.float32(-1e-3)
    assert infos["reward_terms"]["progress"][0] == 0.0


def test_an_ended_env_starts_anew_within_the_step(make_env: MakeEnv) -> None:
    env = make_env(FAR, BED, AT_CHAIR, num_envs=2)
    first, _ = env.reset()
    observations, _, _, _, infos = env.step([Action.STOP, Action.TURN_LEFT])
    assert infos["_episode"].tolist() == infos["_final_obs"].tolist() == [True, False]
    assert infos["final_obs"][1] is None
    for name, values in infos["final_obs"][0].items():
        np.testing.assert_array_equal(values, first[name][0])
    # Sequential order: env 0 of 2 goes on from episode 0 to episode 2.
    assert env.episode_indices.tolist() == [2, 1]
    np.testing.assert_allclose(env.poses[0], [*AT_CHAIR.start_position, AT_CHAIR.start_heading])
    np.testing.assert_array_equal(observations["rgb"][0], env.observations([0])["rgb"][0])
    np.testing.assert_allclose(observations["gps"][0], 0.0)


def test_sequential_order_deals_episodes_out_and_begins_again(make_env: MakeEnv) -> None:
    episodes = [replace(FAR, episode_id=str(number)) for number in range(5)]
    env = make_env(*episodes, num_envs=2)
    env.reset()
    played = [env.episode_indices.tolist()]
    for _ in range(4):
        env.step([Action.STOP, Action.STOP])
        played.append(env.episode_indices.tolist())
    assert played == [[0, 1], [2, 3], [4, 0], [1, 2], [3, 4]]


def test_random_order_follows_the_seed(make_env: MakeEnv) -> None:
    episodes = [replace(FAR, episode_id=str(number)) for number in range(50)]

    def played(env: ObjectNavVectorEnv, seed: int | None) -> list[list[int]]:
        env.reset(seed=seed)
        chosen = [env.episode_indices.tolist()]
        for _ in range(5):
            env.step([Action.STOP] * 3)
            chosen.append(env.episode_indices.tolist())
        return chosen

    env = make_env(*episodes, num_envs=3, order="random", seed=7)
    first = played(env, None)
    assert played(make_env(*episodes, num_envs=3, order="random"), 7) == first
    assert played(env, 7) == first
    assert played(env, None) != first, "without a seed the next episodes come"
    assert played(env, 8) != first
    assert len({tuple(row) for row in first}) == 6
    assert all(len(set(row)) > 1 for row in first), "envs draw from streams of their own"


def test_frames_show_the_same_view_in_another_size(make_env: MakeEnv) -> None:
    env = make_env(FAR, BED)
    observations, _ = env.reset()
    np.testing.assert_array_equal(env.frames([1], 16, 12), observations["rgb"][1:])
    assert env.frames([1, 0, 1], 40, 30).shape == (3, 30, 40, 3)


def test_grids_and_fields_are_at_hand(make_env: MakeEnv) -> None:
    env = make_env(FAR)
    _, infos = env.reset()
    row, col = env.grid(0).cells(env.poses[:, :3])
    field = env.distance_field(0, "chair")
    assert field.dtype == np.float32
    assert field[row, col][0] == pytest.approx(infos["distance_to_goal"][0], abs=0.05)
    assert env.distance_field(0, "bed").shape == field.shape


@pytest.mark.parametrize(
    ("episode", "complaint"),
    [
        (replace(FAR, scene_name="castle"), r"'far' plays in scene 'castle', which is not among"),
        (replace(FAR, object_category="sofa"), r"'far': scene 'divided' has no sofa"),
        (replace(FAR, object_category="unicorn"), r"'far' has the goal 'unicorn', which is not one of chair"),
        (replace(FAR, start_position=(1.25, 0.0, 1.25)), r"'far' starts at .* where an agent cannot stand"),
        (
            replace(FAR, start_position=(4.5, 3.0, 1.25)),
            r"'far' starts at height 3.00 m, but the floor .* is at 0.00 m",
        ),
    ],
)
def test_an_episode_that_cannot_be_played_is_named(make_env: MakeEnv, episode: Episode, complaint: str) -> None:
    with pytest.raises(EpisodeError, match=complaint):
        make_env(BED, episode)


def test_a_goal_that_cannot_be_reached_is_named(make_room) -> None:  # type: ignore[no-untyped-def]
    scene = make_room(
        walls=[(0.0, 0.0, 1.95, 6.0, 2.5, 2.05)], objects=[("chair", (1.0, 0.0, 0.5, 1.5, 0.8, 1.0))], name="divided"
    )
    episode = replace(FAR, start_position=(3.0, 0.0, 4.0))
    with pytest.raises(EpisodeError, match=r"'far': no chair of scene 'divided' can be seen from within 1\.0 m"):
        ObjectNavVectorEnv([scene], [episode], 1)


def test_scenes_need_names_of_their_own(divided_room: Scene) -> None:
    with pytest.raises(SceneError, match="two scenes are called 'divided'"):
        ObjectNavVectorEnv([divided_room, divided_room], [FAR], 1)
    with pytest.raises(EpisodeError, match="no episodes to play"):
        ObjectNavVectorEnv([divided_room], [], 1)


@pytest.mark.parametrize(
    ("indices", "actions", "complaint"),
    [
        ([0, 1], [1], "do not go with actions"),
        ([0, 2], [1, 1], "env index 2 is not one of 0..1"),
        ([0, 0], [1, 1], "name an env twice"),
        ([0], [5], "action 5 is not one of 0..4"),
        ([0], [-1], "action -1 is not one of 0..4"),
        ([0], [1.0], "action must be an integer, not float64"),
    ],
)
def test_bad_steps_are_refused(make_env: MakeEnv, indices: list[int], actions: list[float], complaint: str) -> None:
    env = make_env(FAR, BED)
    env.reset()
    with pytest.raises(ValueError, match=complaint):
        env.step_subset(indices, actions)


def test_stepping_comes_after_reset(make_env: MakeEnv) -> None:
    with pytest.raises(ResetNeeded, match="call reset"):
        make_env(FAR).step([Action.STOP])
    with pytest.raises(ValueError, match="reset takes no options"):
        make_env(FAR).reset(options={"episode": 3})


def test_think_must_be_configured(make_env: MakeEnv) -> None:
    env = make_env(FAR, config=SMALL.model_copy(update={"think_action": False}))
    env.reset()
    with pytest.raises(ValueError, match=r"action 4 is not one of 0\.\.3"):
        env.step([Action.THINK])


def test_state_is_refused_by_another_env(make_env: MakeEnv) -> None:
    env = make_env(FAR, BED)
    env.reset()
    with pytest.raises(ValueError, match="another number of envs"):
        make_env(FAR, BED, num_envs=3).load_state_dict(env.state_dict())
    with pytest.raises(ValueError, match="of an env of 2 episodes; this one has 1"):
        make_env(FAR, num_envs=2).load_state_dict(env.state_dict())


def test_over_stairs_all_lengths_are_measured_from_above(make_room: MakeRoom) -> None:
    stairs = [(2.0 + 0.3 * i, 0.0, 1.0, 6.0, 0.2 * (i + 1), 3.0) for i in range(5)]
    scene = replace(make_room((6.0, 4.0), stairs, [("plant", (5.6, 1.0, 1.8, 5.9, 1.6, 2.2))]), level_floors=False)
    start = Episode("up", "room", (1.0, 0.0, 2.0), -LEFT, "plant", 3.0, 3.0)
    env = ObjectNavVectorEnv([scene], [start], 1, SMALL.model_copy(update={"success": "viewpoint"}))
    before, infos = env.reset()
    follower = ShortestPathFollower(env)
    ended = False
    while not ended:
        height = env.poses[0, 1]
        observations, _, (ended,), _, infos = env.step(follower.actions())
        after = infos["final_obs"][0] or {name: values[0] for name, values in observations.items()}
        led = np.hypot(*(after["gps"] - np.ravel(before["gps"])))
        assert after["moved"][0] == pytest.approx(led, abs=1e-6), f"at height {height}"
        before = after
    env.close()
    assert height == pytest.approx(1.0, abs=1e-3)
    summary = {name: values[0] for name, values in infos["episode"].items()}
    assert summary["path_length"] == pytest.approx(summary["shortest_path_length"], abs=SMALL.forward_step)
    assert summary["success"]
    assert summary["spl"] > 0.95


def test_a_start_a_little_off_the_grid_is_moved_onto_it(make_env: MakeEnv) -> None:
    """As episodes of Habitat's may: its navigation mesh and our grid differ by less than a cell of 0.1 m."""
    grid = make_env(FAR).grid(0)
    rim = float(grid.origin[0] + np.nonzero(grid.navigable.any(axis=0))[0][0] * grid.cell)
    env = make_env(replace(FAR, start_position=(rim - 0.04, 0.0, 2.0)), FAR)
    observations, infos = env.reset()
    assert grid.is_navigable(env.poses)[0]
    assert env.poses[0, 0] == pytest.approx(rim + grid.cell / 2)
    assert np.isfinite(infos["distance_to_goal"]).all()
    np.testing.assert_allclose(observations["gps"], 0.0)
    with pytest.raises(EpisodeError, match="where an agent cannot stand"):
        make_env(replace(FAR, start_position=(rim - 0.14, 0.0, 2.0)))
