"""Records of evaluated episodes: what they hold, their summary, and the files that keep both.

Knows nothing of how episodes are played.
"""

import json
import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thinknav_trainer.config import ConfigError
from thinknav_trainer.farming import FARMING
from thinknav_trainer.statistics import bootstrap_interval

logger = logging.getLogger(__name__)

MEASURES = (
    "success",
    "success_paper",
    "success_viewpoint",
    "spl",
    "soft_spl",
    "sot",
    "distance_to_goal",
    "steps",
    "thinks",
    "think_rate",
    "planner_seconds",
    *FARMING,
)

# scene, id and category of an episode: ids are told apart only within a scene
EpisodeKey = tuple[str, str, str]
# mean, low and high by measure
Summary = dict[str, dict[str, float]]


@dataclass(frozen=True)
class EpisodeRecord:
    """One evaluated episode.

    measures: the task's, and those that docs/evaluation.md and docs/metrics.md define. terms: sums of the reward's.
    path: (x, y, z, heading) before each step. actions: the steps. thoughts: (step, subgoal) for each reply.
    first_seen: the first step at which the goal was in view. failure: why it failed (`failures.Cause`), or none.
    """

    episode_id: str
    scene: str
    category: str
    measures: dict[str, float]
    terms: dict[str, float]
    path: list[list[float]]
    actions: list[int]
    thoughts: list[tuple[int, str]]
    first_seen: int | None
    failure: str | None

    @property
    def episode(self) -> EpisodeKey:
        """Which episode it was."""
        return self.scene, self.episode_id, self.category


def summarize(records: Sequence[EpisodeRecord]) -> Summary:
    """Mean and 95 % bootstrap interval over episodes of each measure and reward term."""
    columns = {name: [record.measures[name] for record in records] for name in MEASURES}
    columns |= {f"reward/{name}": [record.terms[name] for record in records] for name in records[0].terms}
    summary = {}
    for name, values in columns.items():
        low, high = bootstrap_interval(values)
        summary[name] = {"mean": float(np.mean(values)), "low": low, "high": high}
    return summary


def summarize_groups(records: Sequence[EpisodeRecord], key: str) -> dict[str, dict[str, Any]]:
    """By "category" or "scene": the number of episodes, and the summary of the task's measures."""
    groups: dict[str, list[EpisodeRecord]] = {}
    for record in records:
        groups.setdefault(getattr(record, key), []).append(record)
    return {
        name: {"episodes": len(group)}
        | {measure: row for measure, row in summarize(group).items() if measure in MEASURES}
        for name, group in sorted(groups.items())
    }


def count_failures(records: Sequence[EpisodeRecord]) -> dict[str, int]:
    """How many episodes failed for each cause, the commonest first."""
    return dict(Counter(record.failure for record in records if record.failure is not None).most_common())


def write_evaluation(folder: Path, protocol: Mapping[str, Any], records: Sequence[EpisodeRecord]) -> Path:
    """`result.json` (protocol and summaries) and `episodes.jsonl` (every record) in a folder; the path of the first.

    Whoever evaluates again replaces what was there, and is told where that was made otherwise.
    """
    folder.mkdir(parents=True, exist_ok=True)
    changed = _changed_protocol(folder, protocol)
    if changed:
        logger.warning("%s held another evaluation, which is replaced; it differed in %s", folder, ", ".join(changed))
    with (folder / "episodes.jsonl").open("w") as file:
        file.writelines(json.dumps(asdict(record)) + "\n" for record in records)
    result = {
        "protocol": dict(protocol),
        "summary": summarize(records),
        "failures": count_failures(records),
        "by_category": summarize_groups(records, "category"),
        "by_scene": summarize_groups(records, "scene"),
    }
    path = folder / "result.json"
    path.write_text(json.dumps(result, indent=2) + "\n")
    return path


def _changed_protocol(folder: Path, protocol: Mapping[str, Any]) -> list[str]:
    """What is said otherwise by the protocol of the evaluation in a folder, if there is one."""
    try:
        before = json.loads((folder / "result.json").read_text())["protocol"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    now = json.loads(json.dumps(dict(protocol)))
    return sorted(name for name in {*before, *now} if before.get(name) != now.get(name))


def read_evaluation(folder: Path) -> tuple[dict[str, Any], list[EpisodeRecord]]:
    """What `write_evaluation` wrote: result and records. Raises ConfigError for a folder without, or of older form."""
    try:
        result: dict[str, Any] = json.loads((folder / "result.json").read_text())
        lines = (folder / "episodes.jsonl").read_text().splitlines()
        records = [EpisodeRecord(**json.loads(line)) for line in lines]
    except OSError as error:
        raise ConfigError(f"{folder} holds no evaluation: cannot read {error.filename} ({error.strerror})") from None
    except (json.JSONDecodeError, TypeError) as error:
        raise ConfigError(f"{folder} holds an evaluation that cannot be read ({error}); evaluate again") from None
    if not records:
        raise ConfigError(f"{folder} holds an evaluation of no episode; evaluate again")
    missing = sorted({name for record in records for name in MEASURES if name not in record.measures})
    if missing:
        raise ConfigError(f"{folder} holds an older evaluation, without {', '.join(missing)}; evaluate again")
    return result, records
