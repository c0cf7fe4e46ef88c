"""Choosing homes and writing their episodes."""

import json
from collections import Counter
from pathlib import Path

import pytest

from thinknav_sim.episodes import EpisodeError
from thinknav_sim.habitat import from_habitat, read_dataset
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.simple_homes import Candidate, EpisodesWanted, rank_homes, write_episodes

CONFIG = ObjectNavConfig(width=16, height=12)
WANTED = EpisodesWanted(per_home=50, held_out=0.1)


@pytest.fixture(scope="module")
def ranked() -> list[Candidate]:
    return rank_homes(range(3), 2, CONFIG)


@pytest.fixture(scope="module")
def folder(ranked: list[Candidate], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "episodes"
    write_episodes(ranked, 2, WANTED, CONFIG, folder)
    return folder


def test_the_simplest_come_first(ranked: list[Candidate]) -> None:
    assert sorted(candidate.index for candidate in ranked) == [0, 1, 2]
    complexities = [candidate.complexity for candidate in ranked]
    assert complexities == sorted(complexities)
    assert complexities[0] < complexities[-1]
    assert ranked[0].scene().name == ranked[0].name


def test_splits_hold_the_chosen_homes_alike_in_categories(folder: Path, ranked: list[Candidate]) -> None:
    train, held_out = (
        [from_habitat(episode) for episode in read_dataset(folder / split).episodes] for split in ("train", "held_out")
    )
    assert (len(train), len(held_out)) == (90, 10)
    assert {e.scene_name for e in (*train, *held_out)} == {candidate.name for candidate in ranked[:2]}
    assert not {e.episode_id for e in train} & {e.episode_id for e in held_out}
    total, kept = (Counter(e.object_category for e in group) for group in ([*train, *held_out], held_out))
    assert all(abs(kept[category] - 0.1 * total[category]) < 1 for category in total)


def test_what_was_written_can_be_played(folder: Path, ranked: list[Candidate]) -> None:
    episodes = [from_habitat(episode) for episode in read_dataset(folder / "held_out").episodes]
    env = ObjectNavVectorEnv([c.scene() for c in ranked[:2]], episodes, len(episodes), CONFIG, order="sequential")
    distances = env.reset()[1]["distance_to_goal"]
    env.close()
    assert distances == pytest.approx([episode.geodesic_distance for episode in episodes], abs=0.05)


def test_the_choice_is_written_down(folder: Path, ranked: list[Candidate]) -> None:
    written = json.loads((folder / "homes.json").read_text())
    assert [home["name"] for home in written["homes"]] == [candidate.name for candidate in ranked]
    assert [home["taken"] for home in written["homes"]] == [True, True, False]
    assert written["episodes"]["per_home"] == 50
    assert written["task"]["success_distance"] == 1.0


def test_old_files_are_not_written_over(folder: Path, ranked: list[Candidate]) -> None:
    with pytest.raises(EpisodeError, match="is there already, and not an empty folder"):
        write_episodes(ranked, 1, WANTED, CONFIG, folder)
