"""Making episodes and splitting them."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_sim.episodes import Episode, EpisodeError, make_episodes, split_by_category
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Scene


@pytest.fixture(scope="module")
def grid(divided_room: Scene, renderer: Renderer) -> NavigationGrid:
    return NavigationGrid.from_scene(divided_room, renderer)


def episode(category: str, scene_name: str = "room", number: int = 0) -> Episode:
    return Episode(f"{scene_name}-{category}-{number}", scene_name, (1.0, 0.0, 1.0), 0.0, category, 2.0, 2.0)


def test_categories_come_in_turn(divided_room: Scene, grid: NavigationGrid, renderer: Renderer) -> None:
    episodes = make_episodes(divided_room, grid, 21, seed=3, renderer=renderer)
    assert Counter(e.object_category for e in episodes) == {"chair": 11, "bed": 10}
    assert len({e.episode_id for e in episodes}) == 21
    assert {e.scene_name for e in episodes} == {"divided"}


def test_starts_are_navigable_and_as_far_as_asked(
    divided_room: Scene, grid: NavigationGrid, renderer: Renderer
) -> None:
    episodes = make_episodes(divided_room, grid, 60, 0, min_distance=2.0, max_distance=5.0, renderer=renderer)
    assert grid.is_navigable(np.array([e.start_position for e in episodes])).all()
    walked = np.array([e.geodesic_distance for e in episodes])
    straight = np.array([e.euclidean_distance for e in episodes])
    assert ((walked >= 2.0) & (walked <= 5.0)).all()
    assert (straight <= walked + 0.06).all()
    assert (straight < walked - 1.0).any(), "some must go around the wall"
    headings = np.array([e.start_heading for e in episodes])
    assert headings.min() < -2.0
    assert headings.max() > 2.0


def test_the_same_seed_makes_the_same_episodes(divided_room: Scene, grid: NavigationGrid, renderer: Renderer) -> None:
    first, again, other = (make_episodes(divided_room, grid, 10, seed, renderer=renderer) for seed in (1, 1, 2))
    assert first == again
    assert [e.start_position for e in first] != [e.start_position for e in other]


def test_no_goal_at_that_distance_is_an_error(divided_room: Scene, grid: NavigationGrid, renderer: Renderer) -> None:
    with pytest.raises(EpisodeError, match=r"'divided' has no goal .* from 50.0 to 60.0 m away; .*\['bed', 'chair'\]"):
        make_episodes(divided_room, grid, 1, 0, min_distance=50.0, max_distance=60.0, renderer=renderer)


@settings(deadline=None, max_examples=50)
@given(
    counts=st.lists(st.integers(0, 37), min_size=6, max_size=6),
    held_out=st.sampled_from([0.0, 0.1, 0.25, 1.0]),
    seed=st.integers(0, 1000),
)
def test_a_split_is_stratified(counts: list[int], held_out: float, seed: int) -> None:
    groups = [(category, scene) for category in ("bed", "chair", "sofa") for scene in ("a", "b")]
    episodes = [
        episode(category, scene, number)
        for (category, scene), count in zip(groups, counts, strict=True)
        for number in range(count)
    ]
    train, held = split_by_category(episodes, held_out, seed)
    assert sorted(e.episode_id for e in (*train, *held)) == sorted(e.episode_id for e in episodes)
    assert abs(len(held) - held_out * len(episodes)) < 1
    for key in (lambda e: e.object_category, lambda e: (e.object_category, e.scene_name)):
        total, kept = Counter(map(key, episodes)), Counter(map(key, held))
        assert all(abs(kept[group] - held_out * total[group]) < 1 for group in total)
    assert split_by_category(episodes, held_out, seed) == (train, held)


def test_the_seed_chooses_who_is_held_out() -> None:
    episodes = [episode("bed", number=number) for number in range(50)]
    assert split_by_category(episodes, seed=0)[1] != split_by_category(episodes, seed=1)[1]
    with pytest.raises(ValueError, match=r"between 0 and 1, not 1\.5"):
        split_by_category(episodes, held_out=1.5)
