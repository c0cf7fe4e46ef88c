"""Metrics, rewards and sensors against Habitat-Lab's formulas, written out here once more, on recorded trajectories."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.episodes import make_episodes
from thinknav_sim.follower import ShortestPathFollower
from thinknav_sim.habitat import rotation_of
from thinknav_sim.navigation import NavigationGrid, distances_at
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

CONFIG = ObjectNavConfig(width=16, height=12, success="viewpoint", turn_angle=30.0, max_steps=80)
EPISODES = 24
Floats = NDArray[np.float64]


@dataclass
class Trajectory:
    """What was recorded of one episode: poses and distances one longer than rewards and actions."""

    poses: list[Floats]
    distances: list[float]
    observations: list[dict[str, Any]]
    actions: list[int] = field(default_factory=list)
    rewards: list[float] = field(default_factory=list)
    summary: dict[str, float] = field(default_factory=dict)


@pytest.fixture(scope="module")
def trajectories(divided_room: Scene, renderer: Renderer) -> list[Trajectory]:
    """Agents that walk to the goal, stray on the way, bump into walls, and stop at the goal or anywhere."""
    grid = NavigationGrid.from_scene(divided_room, renderer)
    episodes = make_episodes(divided_room, grid, EPISODES, seed=5, config=CONFIG, renderer=renderer)
    env = ObjectNavVectorEnv([divided_room], episodes, 1, CONFIG, order="sequential")
    follower, rng = ShortestPathFollower(env), np.random.default_rng(0)
    recorded = []
    observations, _ = env.reset()
    for number in range(EPISODES):
        fields = env.distance_field(0, episodes[number].object_category)
        one = Trajectory([], [], [])
        stray = (0.0, 0.3, 1.0)[number % 3]
        ended = False
        while not ended:
            pose = env.poses[0]
            one.poses.append(pose)
            one.distances.append(float(distances_at(grid, fields, pose[None])[0]))
            one.observations.append({name: values[0] for name, values in observations.items()})
            action = int(rng.integers(1, 4) if rng.uniform() < stray else follower.actions()[0])
            action = int(Action.STOP) if stray == 1.0 and len(one.actions) == 40 else action
            observations, rewards, terminations, truncations, infos = env.step([action])
            one.actions.append(action)
            one.rewards.append(float(rewards[0]))
            ended = bool(terminations[0] or truncations[0])
        # The env is in its next episode by now: the last step's distance is its own; stop and turns leave it as it was.
        one.distances.append(float(infos["distance_to_goal"][0]))
        one.summary = {name: float(values[0]) for name, values in infos["episode"].items()}
        recorded.append(one)
    env.close()
    return recorded


def test_the_record_has_all_kinds_of_episodes(trajectories: list[Trajectory]) -> None:
    found = [t.summary["success"] for t in trajectories]
    assert 8 <= sum(found) < EPISODES
    assert any(t.summary["collisions"] for t in trajectories)
    assert any(
        t.summary["timed_out"] or (t.actions[-1] == Action.STOP and not t.summary["success"]) for t in trajectories
    )
    assert any(0 < t.summary["soft_spl"] < 1 for t in trajectories)


def test_success_spl_and_softspl(trajectories: list[Trajectory]) -> None:
    for t in (t for t in trajectories if t.actions[-1] == Action.STOP):
        first, last = t.distances[0], t.distances[-1]
        path = 0.0
        for before, after in zip(t.poses, t.poses[1:], strict=False):
            path += math.sqrt(sum((a - b) ** 2 for a, b in zip(after[:3], before[:3], strict=True)))
        success = 1.0 if last < 0.1 else 0.0
        assert t.summary["success"] == success
        assert t.summary["distance_to_goal"] == pytest.approx(last, abs=1e-6)
        assert t.summary["spl"] == pytest.approx(success * first / max(first, path), abs=1e-6)
        assert t.summary["soft_spl"] == pytest.approx(max(0, 1 - last / first) * first / max(first, path), abs=1e-6)


def test_rewards(trajectories: list[Trajectory]) -> None:
    """Slack, the fall of distance_to_goal, and 2.5 where the success measure, "spl", is not zero."""
    for t in trajectories:
        for step, reward in enumerate(t.rewards):
            fallen = t.distances[step] - t.distances[step + 1]
            is_last = step == len(t.rewards) - 1
            paid = 2.5 if is_last and t.summary["spl"] else 0.0
            assert reward == pytest.approx(-1e-3 + fallen + paid, abs=1e-6)


def quaternion_product(a: Floats, b: Floats) -> Floats:
    """Hamilton's, of [x, y, z, w]."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.array([*vector, a[3] * b[3] - a[:3] @ b[:3]])


def inverse(q: Floats) -> Floats:
    conjugate: Floats = q * np.array([-1.0, -1.0, -1.0, 1.0])
    return conjugate


def rotate(q: Floats, vector: Floats) -> Floats:
    turned: Floats = quaternion_product(quaternion_product(q, np.array([*vector, 0.0])), inverse(q))[:3]
    return turned


def test_gps_and_compass(trajectories: list[Trajectory]) -> None:
    """EpisodicGPSSensor and EpisodicCompassSensor: both by quaternions, in the frame of the start."""
    turned = set()
    for t in trajectories:
        origin, start = t.poses[0][:3], np.array(rotation_of(t.poses[0][3]))
        for pose, observed in zip(t.poses, t.observations, strict=True):
            agent = np.array(rotation_of(pose[3]))
            local = rotate(inverse(start), pose[:3] - origin)
            np.testing.assert_allclose(observed["gps"], [-local[2], local[0]], atol=1e-5)
            ahead = rotate(quaternion_product(inverse(agent), start), np.array([0.0, 0.0, -1.0]))
            angle = math.atan2(ahead[0], -ahead[2])
            assert math.cos(observed["compass"][0] - angle) == pytest.approx(1.0, abs=1e-9)
            turned.add(round(angle, 1))
    assert {0.5, -0.5} <= turned


def test_turning_left_counts_up(trajectories: list[Trajectory]) -> None:
    steps = [
        (t.observations[i]["compass"][0], t.observations[i + 1]["compass"][0])
        for t in trajectories
        for i in range(len(t.observations) - 1)
        if t.actions[i] == Action.TURN_LEFT
    ]
    assert steps
    for before, after in steps:
        assert (after - before + math.pi) % (2 * math.pi) - math.pi == pytest.approx(0.5236, abs=1e-4)


def test_depth_and_field_of_view(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    """Every column of the picture, worked out: Habitat's pinhole of 79 degrees, clipped to 0.5 to 5 m, (d - 0.5) / 4.5.

    The agent stands 1.5 m from the wall to its left, 4.5 m from the one to its right, and 3 m from that ahead.
    """
    scene = make_room(objects=[("chair", (4.0, 0.0, 5.0, 4.5, 0.8, 5.5))])
    config = ObjectNavConfig(width=64, height=48)
    grid = NavigationGrid.from_scene(scene, renderer)
    (episode,) = make_episodes(scene, grid, 1, seed=0, config=config, renderer=renderer)
    start = replace(episode, start_position=(1.5, 0.0, 3.0), start_heading=0.0)
    env = ObjectNavVectorEnv([scene], [start], 1, config)
    depth = env.reset()[0]["depth"][0, 24, :, 0]
    env.close()
    across = (np.arange(64) + 0.5 - 32) / 32 * math.tan(math.radians(79) / 2)
    metres = np.minimum(3.0, np.where(across < 0, 1.5, 4.5) / np.abs(across))
    np.testing.assert_allclose(depth, (np.clip(metres, 0.5, 5.0) - 0.5) / 4.5, atol=1e-4)
    assert metres[0] < 2.0 < metres[-1], "left and right differ, or the test could not tell them apart"


def test_defaults_are_those_of_hm3d_objectnav() -> None:
    config = ObjectNavConfig()
    assert (config.hfov, config.camera_height, config.min_depth, config.max_depth) == (79.0, 0.88, 0.5, 5.0)
    assert (config.forward_step, config.max_steps, config.allow_sliding) == (0.25, 500, False)
    assert (config.agent_height, config.agent_radius) == (0.88, 0.18)
    assert (config.success_reward, config.slack_reward) == (2.5, -1e-3)
    assert [action.name for action in Action][:4] == ["STOP", "MOVE_FORWARD", "TURN_LEFT", "TURN_RIGHT"]
