"""What can be played besides a run's own splits: ranges of procedural homes, and Habitat's episode files.

Knows files and homes; nothing of agents.
"""

import filecmp
import logging
import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thinknav_sim.episodes import Episode, EpisodeError
from thinknav_sim.habitat import from_habitat, read_dataset
from thinknav_sim.homes import MAX_ROOMS, generate_home
from thinknav_sim.objectnav import is_of_played_storey, make_grid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene, SceneError
from thinknav_sim.scene_files import SCENE_ENDINGS, scene_name_of
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.home_sets import HomeSet, make_home_set

logger = logging.getLogger(__name__)

# What procedural homes are called: home-SEED, or home-SEED-ROOMS.
_HOME = re.compile(r"home-(\d+)(?:-([1-9]))?")


@dataclass(frozen=True)
class EpisodeSet:
    """Episodes and the scenes that they play in. name: for people and protocols."""

    name: str
    scenes: list[Scene]
    episodes: list[Episode]


def of_homes(homes: HomeSet, count: int, config: ObjectNavConfig) -> EpisodeSet:
    """Episodes in procedural homes: see `make_home_set`."""
    return EpisodeSet(str(homes), *make_home_set(homes, count, config))


def of_file(path: Path, scenes: Path | None, limit: int | None = None) -> EpisodeSet:
    """The episodes of a file in Habitat's format, or of the folder of a split; the first `limit` of them.

    scenes: the folder that their scenes lie in; procedural homes need none.
    One storey of a scan is played in: episodes that start on another are left out, and counted in a warning.
    Raises EpisodeError for a file that is not in order or has no episode left, SceneError for a scene that is not there
    or not the only one of its name.
    """
    episodes = [from_habitat(episode) for episode in read_dataset(path).episodes][:limit]
    if not episodes:
        raise EpisodeError(f"{path} holds no episodes")
    loaded = _load(sorted({episode.scene_name for episode in episodes}), scenes, path)
    playable = _of_played_storeys(episodes, loaded)
    if len(playable) < len(episodes):
        left_out = f"{len(episodes) - len(playable)} of the {len(episodes)} episodes of {path}"
        why = "start on another storey of their scene than the one that is played in"
        if not playable:
            raise EpisodeError(f"{left_out} {why}; none is left")
        logger.warning("%s %s; they are left out", left_out, why)
    names = {episode.scene_name for episode in playable}
    return EpisodeSet(str(path), [scene for scene in loaded if scene.name in names], playable)


def _of_played_storeys(episodes: list[Episode], scenes: list[Scene]) -> list[Episode]:
    renderer, config = make_renderer(), ObjectNavConfig()
    scans = {scene.name: (scene, make_grid(scene, renderer, config)) for scene in scenes if not scene.level_floors}
    return [
        episode
        for episode in episodes
        if episode.scene_name not in scans
        or is_of_played_storey(*scans[episode.scene_name], np.array(episode.start_position, np.float64))
    ]


def _load(names: Iterable[str], folder: Path | None, asked_by: Path) -> list[Scene]:
    """The scenes of these names. All that are missing are named at once."""
    from thinknav_sim.scans import load_scan

    if folder is not None and not folder.is_dir():
        raise SceneError(f"the scenes' folder {folder} does not exist")
    files = {} if folder is None else _files(folder)
    loaded, missing = [], []
    for name in names:
        home = _HOME.fullmatch(name)
        if name in files:
            loaded.append(replace(load_scan(_best(files[name])).scene, name=name))
        elif home is not None and int(home[2] or 1) <= MAX_ROOMS:
            loaded.append(generate_home(int(home[1]), int(home[2]) if home[2] else None))
        else:
            missing.append(name)
    if missing:
        where = "no folder of scenes was given" if folder is None else f"in {folder} there is no {missing[0]}.glb"
        raise SceneError(
            f"{asked_by} plays in {len(missing)} scenes that cannot be found, such as {missing[0]!r}: {where} "
            f"(nor {', '.join(ending for ending in SCENE_ENDINGS if ending != '.glb')})"
        )
    return loaded


def _files(folder: Path) -> dict[str, list[Path]]:
    """Scene names to the files of each, anywhere in a folder: those of the best ending first."""
    found: defaultdict[str, list[Path]] = defaultdict(list)
    paths = [path for path in sorted(folder.rglob("*")) if path.name.endswith(SCENE_ENDINGS)]
    for path in sorted(paths, key=_rank):
        if not path.name.endswith(".semantic.glb"):
            found[scene_name_of(path.name)].append(path)
    return found


def _rank(path: Path) -> int:
    return next(rank for rank, ending in enumerate(SCENE_ENDINGS) if path.name.endswith(ending))


def _best(files: list[Path]) -> Path:
    """The file to take of those of a scene. Raises SceneError where two of its ending are not the same scene."""
    for other in files[1:]:
        # HM3D's minival holds copies of scenes of val: either will do.
        if _rank(other) == _rank(files[0]) and not filecmp.cmp(files[0], other, shallow=False):
            raise SceneError(f"{files[0]} and {other} are two scenes of one name; move one of them elsewhere")
    return files[0]
