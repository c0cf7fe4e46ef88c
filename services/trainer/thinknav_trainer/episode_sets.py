"""What can be played besides a run's own splits: ranges of procedural homes, and Habitat's episode files.

Knows files and homes; nothing of agents.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from thinknav_sim.episodes import Episode, EpisodeError
from thinknav_sim.habitat import from_habitat, read_dataset
from thinknav_sim.homes import MAX_ROOMS, generate_home
from thinknav_sim.scene import Scene, SceneError
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.home_sets import HomeSet, make_home_set

# Files that a scene may lie in, the first that is there taken: imported, HM3D's, any other scan.
_ENDINGS = (".npz", ".basis.glb", ".glb", ".obj", ".ply")
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
    Raises EpisodeError for a file that is not in order, SceneError for a scene that is not there.
    """
    episodes = [from_habitat(episode) for episode in read_dataset(path).episodes][:limit]
    if not episodes:
        raise EpisodeError(f"{path} holds no episodes")
    names = sorted({episode.scene_name for episode in episodes})
    return EpisodeSet(str(path), _load(names, scenes, path), episodes)


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
            loaded.append(replace(load_scan(files[name]).scene, name=name))
        elif home is not None and int(home[2] or 1) <= MAX_ROOMS:
            loaded.append(generate_home(int(home[1]), int(home[2]) if home[2] else None))
        else:
            missing.append(name)
    if missing:
        where = "no folder of scenes was given" if folder is None else f"in {folder} there is no {missing[0]}.glb"
        raise SceneError(
            f"{asked_by} plays in {len(missing)} scenes that cannot be found, such as {missing[0]!r}: {where} "
            f"(nor {', '.join(ending for ending in _ENDINGS if ending != '.glb')})"
        )
    return loaded


def _files(folder: Path) -> dict[str, Path]:
    """Scene names to files anywhere in a folder, by the best ending of each."""
    found: dict[str, Path] = {}
    for path in sorted(folder.rglob("*")):
        if path.name.endswith((".semantic.glb", ".basis.navmesh")) or not path.name.endswith(_ENDINGS):
            continue
        name = path.name.split(".", 1)[0]
        if name not in found or _rank(path) < _rank(found[name]):
            found[name] = path
    return found


def _rank(path: Path) -> int:
    return next(rank for rank, ending in enumerate(_ENDINGS) if path.name.endswith(ending))
