"""Reading and writing Habitat's episode files: `{split}.json.gz`, and `content/{scene}.json.gz` beside it.

Knows nothing of what episodes mean. Every problem is an `EpisodeFileError` that names file, episode and field.
"""

import gzip
import json
import zlib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from thinknav_sim.episodes import EpisodeError
from thinknav_sim.habitat.schema import HabitatDataset, HabitatFile

CONTENT = "content"
_GZIP_MAGIC = b"\x1f\x8b"
_ENDINGS = (".json.gz", ".json")


class EpisodeFileError(EpisodeError):
    """A file of episodes that cannot be read or written; the message names it, the episode and the field."""


def read_dataset(path: Path) -> HabitatDataset:
    """Read a split: a file, or the folder that has one of its own name in it; with the content files beside it.

    Raises EpisodeFileError.
    """
    if path.is_dir():
        path = _split_file(path)
    content = path.parent / CONTENT
    scenes = sorted(file for file in content.iterdir() if file.name.endswith(_ENDINGS)) if content.is_dir() else []
    return HabitatDataset(index=read_file(path), content={_stem(file): read_file(file) for file in scenes})


def _split_file(folder: Path) -> Path:
    for ending in _ENDINGS:
        if (folder / f"{folder.resolve().name}{ending}").is_file():
            return folder / f"{folder.resolve().name}{ending}"
    raise EpisodeFileError(f"{folder} has no {folder.resolve().name}.json.gz in it; give the file itself")


def _stem(path: Path) -> str:
    return next(path.name.removesuffix(ending) for ending in _ENDINGS if path.name.endswith(ending))


def read_file(path: Path) -> HabitatFile:
    """Read one file, compressed or not. Raises EpisodeFileError."""
    document = _read_json(path)
    try:
        return HabitatFile.model_validate(document)
    except ValidationError as error:
        raise EpisodeFileError(f"{path}: {_explain(error, document)}") from None


def _read_json(path: Path) -> Any:
    try:
        data = path.read_bytes()
        return json.loads(gzip.decompress(data) if data.startswith(_GZIP_MAGIC) else data)
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise EpisodeFileError(f"{path} is not a whole gzip file: {error}") from None
    except (ValueError, RecursionError) as error:  # not JSON, not text, or numbers and nesting without measure
        raise EpisodeFileError(f"{path} is not JSON: {error}") from None
    except OSError as error:
        raise EpisodeFileError(f"{path} cannot be read: {error.strerror or error}") from None


def _explain(error: ValidationError, document: Any) -> str:
    """The first problem, its place in the words of the file, and how many more there are."""
    problems = error.errors(include_url=False)
    first = problems[0]
    place = list(first["loc"])
    where = "the file"
    if place[:1] == ["episodes"] and len(place) > 1:
        number = int(place[1])
        episode = document["episodes"][number]
        named = isinstance(episode, dict) and "episode_id" in episode
        where = f"episode {number} (id {episode['episode_id']!r})" if named else f"episode {number}"
        place = place[2:]
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    message = first["msg"].removeprefix("Value error, ")
    message = f"{message[0].lower()}{message[1:]}"
    return f"{where}, field {field!r}: {message}{more}" if field else f"{where}: {message}{more}"


def write_dataset(dataset: HabitatDataset, folder: Path, split: str) -> Path:
    """Write `{folder}/{split}/{split}.json.gz` and the content files beside it; returns the former.

    Raises EpisodeFileError.
    """
    index = folder / split / f"{split}.json.gz"
    write_file(dataset.index, index)
    for scene, file in dataset.content.items():
        write_file(file, index.parent / CONTENT / f"{scene}.json.gz")
    return index


def write_file(file: HabitatFile, path: Path) -> None:
    """Write one file, compressed if its name ends in .gz; the same episodes give the same bytes.

    Raises EpisodeFileError.
    """
    data = json.dumps(file.as_json(), separators=(",", ":")).encode()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.compress(data, mtime=0) if path.name.endswith(".gz") else data)
    except OSError as error:
        raise EpisodeFileError(f"{path} cannot be written: {error.strerror or error}") from None
