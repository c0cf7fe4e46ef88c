"""The simplest of many homes, and episodes in them as files of Habitat's.

Knows the simulator; nothing of runs or learning.
"""

import json
import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from thinknav_sim.episodes import Episode, EpisodeError, make_episodes, split_by_category
from thinknav_sim.habitat import HabitatDataset, HabitatFile, SceneGoals, category_ids, write_dataset
from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.navigation import navigation_complexity
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import ObjectNavConfig

logger = logging.getLogger(__name__)

TRAIN, HELD_OUT = "train", "held_out"
HOMES_FILE = "homes.json"


@dataclass(frozen=True)
class Candidate:
    """A home that could be taken.

    index: in the training range of homes. seed, rooms: as `generate_home` wants them. complexity: see docs/episodes.md.
    """

    name: str
    index: int
    seed: int
    rooms: int | None
    complexity: float

    def scene(self) -> Scene:
        """The home itself."""
        return generate_home(self.seed, self.rooms)


@dataclass(frozen=True)
class EpisodesWanted:
    """How many episodes in each home, the share held out, and how long the way may be, metres."""

    per_home: int = 400
    held_out: float = 0.1
    min_distance: float = 1.0
    max_distance: float = 30.0


def rank_homes(indices: Sequence[int], rooms: int | None, config: ObjectNavConfig) -> list[Candidate]:
    """The training homes of these indices, those that are simplest to walk first."""
    renderer = make_renderer()
    ranked = []
    for index in indices:
        seed = home_seed("train", index)
        scene = generate_home(seed, rooms)
        complexity = navigation_complexity(make_grid(scene, renderer, config))
        logger.info("%s has navigation complexity %.2f", scene.name, complexity)
        ranked.append(Candidate(scene.name, index, seed, rooms, round(complexity, 4)))
    return sorted(ranked, key=lambda candidate: (candidate.complexity, candidate.index))


def check_is_free(folder: Path) -> None:
    """Raises EpisodeError for a folder that has something in it: old content files would be read with the new."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise EpisodeError(f"{folder} is there already, and not an empty folder; give another --output")


def write_episodes(
    candidates: Sequence[Candidate], keep: int, wanted: EpisodesWanted, config: ObjectNavConfig, folder: Path
) -> dict[str, HabitatDataset]:
    """Make episodes in the first `keep` of ranked homes, split them by category, and write both splits.

    The folder (see `check_is_free`) gets `{split}/{split}.json.gz` with `content/` beside it for train and
    held_out, and homes.json: every candidate, and which were taken.
    Returns the splits by name. Raises EpisodeError.
    """
    check_is_free(folder)
    renderer = make_renderer()
    episodes: list[Episode] = []
    goals: dict[str, SceneGoals] = {}
    for candidate in candidates[:keep]:
        scene = candidate.scene()
        grid = make_grid(scene, renderer, config)
        goals[scene.name] = SceneGoals.of(scene, grid, renderer, config)
        episodes += make_episodes(
            scene,
            grid,
            wanted.per_home,
            seed=candidate.index,
            min_distance=wanted.min_distance,
            max_distance=wanted.max_distance,
            config=config,
            renderer=renderer,
        )
    train, held_out = split_by_category(episodes, held_out=wanted.held_out, seed=0)
    splits = {TRAIN: _dataset(train, goals), HELD_OUT: _dataset(held_out, goals)}
    for name, dataset in splits.items():
        write_dataset(dataset, folder, name)
    rows = [asdict(candidate) | {"taken": rank < keep} for rank, candidate in enumerate(candidates)]
    protocol = {"homes": rows, "episodes": asdict(wanted), "task": config.model_dump()}
    (folder / HOMES_FILE).write_text(json.dumps(protocol, indent=2) + "\n")
    return splits


def _dataset(episodes: Sequence[Episode], goals: dict[str, SceneGoals]) -> HabitatDataset:
    content = {
        name: scene_goals.file([episode for episode in episodes if episode.scene_name == name])
        for name, scene_goals in goals.items()
    }
    index = HabitatFile.model_validate({"episodes": (), **category_ids()})
    return HabitatDataset(index=index, content=content)
