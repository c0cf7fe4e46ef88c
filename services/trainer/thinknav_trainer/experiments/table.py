"""The outcome of an experiment as a table: means over seeds with 95 % intervals, in Markdown and in JSON.

The interval is Student's, over the means of the seeds: it says how far another seed may fall, not another episode.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

from thinknav_trainer.config import TrainConfig
from thinknav_trainer.experiments.experiment import Experiment
from thinknav_trainer.files import replace_text
from thinknav_trainer.records import EpisodeRecord
from thinknav_trainer.statistics import student_interval

MEASURES = ("success", "spl", "soft_spl", "distance_to_goal", "sot", "steps", "thinks", "think_rate")
_SHOWN = ("success", "spl", "distance_to_goal", "sot", "steps", "think_rate")


@dataclass(frozen=True)
class Outcome:
    """A seed of an arm: its configuration, and its evaluated episodes."""

    arm: str
    seed: int
    config: TrainConfig
    records: Sequence[EpisodeRecord]

    def mean(self, measure: str) -> float:
        """Over the episodes."""
        return fmean(record.measures[measure] for record in self.records)


def write_table(folder: Path, experiment: Experiment, outcomes: Sequence[Outcome]) -> Path:
    """`result.json` and `result.md` in a folder; the path of the second. All arms have the same seeds."""
    result = {"protocol": _protocol(experiment, outcomes), "arms": _arms(experiment, outcomes)}
    replace_text(folder / "result.json", json.dumps(result, indent=2) + "\n")
    page = folder / "result.md"
    replace_text(page, _markdown(result))
    return page


def _arms(experiment: Experiment, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    arms = {}
    for arm in experiment.arms:
        own = [outcome for outcome in outcomes if outcome.arm == arm.name]
        arms[arm.name] = {measure: _over_seeds([outcome.mean(measure) for outcome in own]) for measure in MEASURES}
    return arms


def _over_seeds(values: list[float]) -> dict[str, Any]:
    """Mean, interval (none of one seed) and the values themselves."""
    low, high = student_interval(values) if len(values) > 1 else (None, None)
    return {"mean": fmean(values), "low": low, "high": high, "per_seed": values}


def _protocol(experiment: Experiment, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    first = outcomes[0]
    return {
        "experiment": experiment.name,
        "question": experiment.question,
        "seeds": sorted({outcome.seed for outcome in outcomes}),
        "total_steps": first.config.total_steps,
        "split": "held_out",
        "episodes": len(first.records),
        "scenes": sorted({record.scene for record in first.records}),
        "actions": "sampled",
        "interval": "95 %, Student's t over seeds",
        "privileged_planner": {outcome.arm: outcome.config.planner.knows_the_map for outcome in outcomes},
        "arms": {arm.name: list(arm.overrides) for arm in experiment.arms},
        "config": first.config.model_dump(mode="json"),
    }


def _markdown(result: dict[str, Any]) -> str:
    protocol = result["protocol"]
    rows = []
    for name, measures in result["arms"].items():
        cells = " | ".join(_cell(measures[measure]) for measure in _SHOWN)
        rows.append(f"| {name} | {cells} |")
    privileged = [arm for arm, told in protocol["privileged_planner"].items() if told]
    notes = [
        f"{protocol['total_steps']:,} steps, {len(protocol['seeds'])} seed(s), {protocol['episodes']} held-out "
        f"episodes in {', '.join(protocol['scenes'])}, sampled actions; mean over seeds ({protocol['interval']}).",
        f"The planner is privileged in: {', '.join(privileged) or 'no arm'}.",
    ]
    header = ["| arm | " + " | ".join(_SHOWN) + " |", "|---" * (len(_SHOWN) + 1) + "|"]
    return "\n".join([f"# {protocol['experiment']}", "", protocol["question"], "", *header, *rows, "", *notes, ""])


def _cell(row: dict[str, Any]) -> str:
    if row["low"] is None:
        return f"{row['mean']:.3f}"
    return f"{row['mean']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
