"""Our episodes in Habitat's notation and back; goals and viewpoints that agree with our distances."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thinknav_sim.episodes import Episode, EpisodeError, make_episodes
from thinknav_sim.habitat import HabitatFile, SceneGoals, from_habitat, heading_of, rotation_of, to_habitat
from thinknav_sim.navigation import NavigationGrid, distance_field, distances_at
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene

EPISODE = Episode("e-1", "home-3", (1.25, 0.0, -3.5), 2.0, "toilet", 4.5, 3.25)


@pytest.fixture(scope="module")
def grid(divided_room: Scene, renderer: Renderer) -> NavigationGrid:
    return NavigationGrid.from_scene(divided_room, renderer)


@pytest.fixture(scope="module")
def goals(divided_room: Scene, grid: NavigationGrid, renderer: Renderer) -> SceneGoals:
    return SceneGoals.of(divided_room, grid, renderer)


def rotated(
    rotation: tuple[float, ...], vector: tuple[float, float, float]
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """v + 2 w (u x v) + 2 u x (u x v), for a quaternion [u, w]."""
    u, w, v = np.array(rotation[:3]), rotation[3], np.array(vector)
    turned: np.ndarray[tuple[int], np.dtype[np.float64]] = v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))
    return turned


@given(st.floats(-10.0, 10.0))
def test_a_rotation_looks_where_the_heading_looks(heading: float) -> None:
    forward = rotated(rotation_of(heading), (0.0, 0.0, -1.0))
    np.testing.assert_allclose(forward, [-math.sin(heading), 0.0, -math.cos(heading)], atol=1e-12)


@pytest.mark.parametrize(
    ("rotation", "heading"),
    [
        ([0, 0, 0, 1], 0.0),
        ([0, math.sin(math.pi / 12), 0, math.cos(math.pi / 12)], math.pi / 6),  # one turn_left of 30 degrees
        ([0, -math.sin(math.pi / 12), 0, -math.cos(math.pi / 12)], math.pi / 6),  # the same rotation
        ([0, 0.7071068, 0, -0.7071068], -math.pi / 2),
    ],
)
def test_headings_of_known_rotations(rotation: list[float], heading: float) -> None:
    assert heading_of(rotation) == pytest.approx(heading, abs=1e-6)


@given(heading=st.floats(-3.1, 3.1), pitch=st.floats(-1.4, 1.4))
def test_looking_up_or_down_changes_no_heading(heading: float, pitch: float) -> None:
    s, c, sp, cp = math.sin(heading / 2), math.cos(heading / 2), math.sin(pitch / 2), math.cos(pitch / 2)
    assert heading_of((c * sp, s * cp, -s * sp, c * cp)) == pytest.approx(heading, abs=1e-9)


@given(heading=st.floats(-math.pi, math.pi), x=st.floats(-100, 100), y=st.floats(-10, 10))
def test_there_and_back(heading: float, x: float, y: float) -> None:
    episode = replace(EPISODE, start_heading=heading, start_position=(x, y, 0.1))
    back = from_habitat(to_habitat(episode, 5))
    assert math.cos(back.start_heading - heading) == pytest.approx(1.0, abs=1e-12)
    assert replace(back, start_heading=heading) == episode


@pytest.mark.parametrize(
    ("scene_id", "name"),
    [
        ("hm3d/val/00800-TEEsavR23oF/TEEsavR23oF.basis.glb", "TEEsavR23oF"),
        ("mp3d/17DRP5sb8fy/17DRP5sb8fy.glb", "17DRP5sb8fy"),
        ("hssd-hab/scenes/102343992.scene_instance.json", "102343992"),
        ("thinknav/flat.2", "flat.2"),
        ("scans\\flat.2.GLB", "flat.2"),
    ],
)
def test_scenes_lose_their_endings_and_no_other_part_of_their_names(scene_id: str, name: str) -> None:
    written = to_habitat(replace(EPISODE, scene_name="flat.2"), 5)
    assert from_habitat(written).scene_name == "flat.2"
    assert from_habitat(written.model_copy(update={"scene_id": scene_id})).scene_name == name


def test_keys_are_those_of_habitat() -> None:
    written = to_habitat(EPISODE, 5).as_json()
    assert set(written) == {
        "episode_id",
        "scene_id",
        "scene_dataset_config",
        "additional_obj_config_paths",
        "start_position",
        "start_rotation",
        "info",
        "goals",
        "start_room",
        "shortest_paths",
        "object_category",
    }
    assert written["info"] == {"geodesic_distance": 4.5, "euclidean_distance": 3.25, "closest_goal_object_id": 5}


@pytest.mark.parametrize(
    "distance", [None, "3", True, math.nan, math.inf, -1.0, pytest.param(10**400, id="401 digits")]
)
def test_an_episode_without_distances_is_named(distance: object) -> None:
    written = to_habitat(EPISODE, 5)
    for name in ("geodesic_distance", "euclidean_distance"):
        broken = written.model_copy(update={"info": {**(written.info or {}), name: distance}})
        with pytest.raises(EpisodeError, match=rf"episode 'e-1': info\.{name} must be a number of metres, not "):
            from_habitat(broken)


def test_viewpoints_are_the_success_zone(
    divided_room: Scene, grid: NavigationGrid, renderer: Renderer, goals: SceneGoals
) -> None:
    """Habitat's distance_to_goal, measured to the viewpoints written, is the episode's geodesic distance."""
    episodes = make_episodes(divided_room, grid, 30, seed=0, renderer=renderer)
    file = HabitatFile.model_validate(goals.file(episodes).as_json())
    assert [from_habitat(episode).episode_id for episode in file.episodes] == [e.episode_id for e in episodes]
    for episode, written in zip(episodes, file.episodes, strict=True):
        (goal,) = file.goals_of(written)
        places = np.array([view.agent_state.position for view in goal.view_points])
        targets = np.zeros(grid.shape, np.bool_)
        targets[grid.cells(places)] = True
        walked = distances_at(grid, distance_field(grid, targets), np.array([episode.start_position]))[0]
        assert walked == pytest.approx(episode.geodesic_distance, abs=grid.cell)
        assert (written.info or {})["closest_goal_object_id"] == goal.object_id


def test_viewpoints_face_the_object_and_see_it(goals: SceneGoals) -> None:
    (chair,) = goals.goals["chair"]
    middle = np.array(chair.position)
    assert chair.view_points
    for view in chair.view_points:
        ahead = middle - view.agent_state.position
        forward = rotated(view.agent_state.rotation, (0.0, 0.0, -1.0))
        flat = np.hypot(ahead[0], ahead[2])
        assert (forward[0] * ahead[0] + forward[2] * ahead[2]) / flat == pytest.approx(1.0, abs=1e-4)
        assert 0.0 < (view.iou or 0.0) <= 1.0


def test_an_episode_of_another_scene_is_refused(goals: SceneGoals) -> None:
    with pytest.raises(EpisodeError, match=r"'e-1' does not fit scene 'divided'"):
        goals.file([EPISODE])
