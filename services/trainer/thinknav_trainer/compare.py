"""Evaluations side by side: the same episodes, and what one agent gains over another in each of them.

Episodes differ far more than agents do, so differences are taken episode by episode, and their interval is narrower
than those of the two means suggest. Knows files of evaluations; nothing of what was evaluated.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from thinknav_trainer.config import ConfigError
from thinknav_trainer.records import MEASURES, EpisodeKey, EpisodeRecord, Summary, read_evaluation, summarize
from thinknav_trainer.statistics import bootstrap_interval


@dataclass(frozen=True)
class Evaluated:
    """An evaluation: what to call it, where it lies, and its records."""

    name: str
    folder: Path
    records: list[EpisodeRecord]


@dataclass(frozen=True)
class Column:
    """One evaluation's summary, and by how much each mean is above the first one's; none for the first itself."""

    name: str
    summary: Summary
    difference: Summary


def find_evaluation(path: Path) -> Path:
    """The folder of an evaluation: `path` itself, or the last one of the run that `path` is. Raises ConfigError."""
    if (path / "result.json").is_file():
        return path
    inner = sorted(path.glob("evaluations/*/result.json"))
    if not inner:
        raise ConfigError(f"{path} holds no evaluation, nor a run with one; run thinknav eval first")
    return inner[-1].parent


def read_evaluations(paths: Sequence[Path]) -> list[Evaluated]:
    """The evaluations at these paths. Raises ConfigError where one cannot be read, or their episodes differ."""
    read = [
        Evaluated(_name(path, folder), folder, read_evaluation(folder)[1])
        for path, folder in ((path, find_evaluation(path)) for path in paths)
    ]
    for other in read[1:]:
        require_same_episodes(str(read[0].folder), episodes_of(read[0].records), str(other.folder), other.records)
    return read


def compare(evaluations: Sequence[Evaluated]) -> list[Column]:
    """A column for each evaluation; differences with 95 % paired bootstrap intervals, from the first one."""
    first = evaluations[0].records
    columns = [Column(evaluations[0].name, summarize(first), {})]
    for other in evaluations[1:]:
        theirs = {record.episode: record for record in other.records}
        pairs = [(record, theirs[record.episode]) for record in first]
        difference = {}
        for measure in MEASURES:
            gains = [after.measures[measure] - before.measures[measure] for before, after in pairs]
            low, high = bootstrap_interval(gains)
            difference[measure] = {"mean": sum(gains) / len(gains), "low": low, "high": high}
        columns.append(Column(other.name, summarize(other.records), difference))
    return columns


def episodes_of(records: Sequence[EpisodeRecord]) -> set[EpisodeKey]:
    """Which episodes an evaluation is of."""
    return {record.episode for record in records}


def require_same_episodes(one: str, ours: set[EpisodeKey], other: str, records: Sequence[EpisodeRecord]) -> None:
    """Refuse to compare evaluations, so named, of different episodes. Raises ConfigError."""
    theirs = episodes_of(records)
    if ours != theirs:
        odd = min(ours ^ theirs)
        raise ConfigError(
            f"{one} and {other} are of different episodes ({len(ours)} and {len(theirs)}, {len(ours & theirs)} in "
            f"both): only {one if odd in ours else other} has {odd[1]!r}; evaluate both on the same ones"
        )


def _name(path: Path, folder: Path) -> str:
    return path.name if path == folder else f"{path.name} {folder.name}"
