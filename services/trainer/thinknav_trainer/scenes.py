"""The homes of a run and their episodes, split into training and held-out ones.

Knows configuration and simulator; nothing of learning.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from thinknav_sim.episodes import Episode, make_episodes, split_by_category
from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene, SceneError
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.episode_sets import of_file


@dataclass(frozen=True)
class Homes:
    """Scenes with their training, held-out and validation episodes, which share none."""

    scenes: list[Scene]
    train: list[Episode]
    held_out: list[Episode]
    validation: list[Episode] = field(default_factory=list)


def make_homes(config: TrainConfig) -> Homes:
    """Homes, generated or scanned, and episodes, made or read.

    They follow `config.scenes` alone: every seed meets the same ones.
    """
    wanted = config.scenes
    if wanted.episodes_file is not None:
        given = of_file(Path(wanted.episodes_file), None if wanted.folder is None else Path(wanted.folder))
        scenes, episodes = given.scenes, list(given.episodes)
    else:
        scenes, episodes = _made(config)
    train, held_out = split_by_category(episodes, held_out=wanted.held_out, seed=0)
    if not wanted.validation:
        return Homes(scenes, list(train), list(held_out))
    train, validation = split_by_category(train, held_out=wanted.validation, seed=1)
    return Homes(scenes, list(train), list(held_out), list(validation))


def _made(config: TrainConfig) -> tuple[list[Scene], list[Episode]]:
    """Homes, generated or scanned, and the episodes that are made in them."""
    wanted = config.scenes
    count = len(wanted.scans) or wanted.homes
    indices = wanted.chosen or range(wanted.first_home, wanted.first_home + count)
    scenes = _load_scans(wanted.scans) if wanted.scans else _generate(indices, wanted.rooms)
    renderer = make_renderer()
    episodes: list[Episode] = []
    for index, scene in enumerate(scenes):
        episodes += make_episodes(
            scene,
            make_grid(scene, renderer, config.env),
            wanted.episodes,
            seed=indices[index],
            min_distance=wanted.min_distance,
            max_distance=wanted.max_distance,
            config=config.env,
            renderer=renderer,
        )
    return scenes, episodes


def _generate(indices: Sequence[int], rooms: int | None) -> list[Scene]:
    return [generate_home(home_seed("train", index), rooms=rooms) for index in indices]


def _load_scans(paths: tuple[str, ...]) -> list[Scene]:
    """The scans at these paths. Raises SceneError, also where two of them have one name: episodes go by it."""
    from thinknav_sim.scans import load_scan

    scenes: dict[str, Scene] = {}
    for path in paths:
        scene = load_scan(Path(path)).scene
        if scene.name in scenes:
            raise SceneError(f"scenes.scans: {path} is a second scene called {scene.name!r}; rename its file")
        scenes[scene.name] = scene
    return list(scenes.values())
