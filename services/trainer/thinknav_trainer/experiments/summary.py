"""The lines of a ledger as one result: means over seeds with 95 % intervals, ratios and differences, the protocol.

An arm's interval is Student's, over the means of its seeds: it says how far another seed may fall, not another episode.
That of a ratio, or of a difference, is a percentile bootstrap over seeds: each arm's seeds are drawn anew,
independently of the other's, for a seed of one has nothing in common with the same one of another.
"""

import shlex
from collections.abc import Sequence
from statistics import fmean
from typing import Any

from thinknav_trainer.experiments.downsample import rounded
from thinknav_trainer.experiments.experiment import Arm, Experiment
from thinknav_trainer.experiments.ledger import Line
from thinknav_trainer.experiments.work import REPLACED
from thinknav_trainer.statistics import compare_means, student_interval

PAPER = "agent-paper"
BEST = "agent-best"
CALLS_PER_SUCCESS = "calls_per_success"
COMPARED = ("spl", "success", "soft_spl", "distance_to_goal", "sot")

Stats = dict[str, Any]  # mean, low, high, per_seed


def summarize(experiment: Experiment, lines: Sequence[Line]) -> dict[str, Any]:
    """`protocol`, `arms`, `ratios`; and `differences`, `masked`, `shuffled`, `agents`."""
    arms = {arm.name: own for arm in experiment.arms if (own := lines_of(arm, lines))}
    statistics = {name: over_seeds([line["measures"] for line in own]) for name, own in arms.items()}
    compared = _compared(experiment, arms)
    replaced = {
        kind: {
            name: over_seeds([line[kind] for line in own])
            for name, own in arms.items()
            if all(line.get(kind) for line in own)
        }
        for kind in REPLACED
    }
    rows = {line["arm"]: line["measures"] for line in lines if line["agent"]}
    return {
        "protocol": protocol_of(experiment, arms, lines),
        "arms": statistics,
        "ratios": {name: _compare(*pair, ratio=True) for name, pair in compared.items()},
        "differences": {name: _compare(*pair, ratio=False) for name, pair in compared.items()},
        **replaced,
        "agents": rows,
    }


def lines_of(arm: Arm, lines: Sequence[Line]) -> list[Line]:
    """An arm's, in the order of their seeds."""
    own = [line for line in lines if line["arm"] == arm.name and not line["agent"]]
    return sorted(own, key=lambda line: int(line["seed"]))


def over_seeds(rows: Sequence[dict[str, float | None]]) -> dict[str, Stats]:
    """Mean, interval and the values themselves, by measure; the mean is of the seeds that have one.

    But calls per success are all calls over all successes: a seed without success would else make them look fewer.
    """
    names = list(dict.fromkeys(name for row in rows for name in row))
    statistics = {name: _over_seeds([row.get(name) for row in rows]) for name in names}
    if CALLS_PER_SUCCESS in statistics:
        thinks, success = statistics["thinks"]["mean"], statistics["success"]["mean"]
        pooled = {"mean": thinks / success if success else None, "low": None, "high": None}
        statistics[CALLS_PER_SUCCESS] |= _rounded(pooled)
    return statistics


def _over_seeds(values: Sequence[float | None]) -> Stats:
    there = [value for value in values if value is not None]
    low, high = student_interval(there) if len(there) > 1 else (None, None)
    mean = fmean(there) if there else None
    return {**_rounded({"mean": mean, "low": low, "high": high}), "per_seed": list(values)}


def _rounded(row: dict[str, float | None]) -> Stats:
    return {name: None if value is None else rounded(value) for name, value in row.items()}


def _compared(experiment: Experiment, arms: dict[str, list[Line]]) -> dict[str, tuple[list[Line], list[Line]]]:
    """What stands over the baseline, by the name of the ratio; other steps or sensors, over one that has them too and
    comes before them. And the arms that say over which other one they stand.
    """
    baseline = experiment.baseline
    if baseline is None or baseline not in arms:
        return {}
    wanted = {BEST: experiment.best, PAPER: PAPER}
    pairs = {f"{name}/{baseline}": (arms[arm], arms[baseline]) for name, arm in wanted.items() if arm in arms}
    conditions = _conditions(experiment)
    names = list(arms)
    for place, other in enumerate(names):
        if other.startswith(f"{baseline}-") and conditions[other] != conditions[baseline]:
            alike = (name for name in names[place + 1 :] if conditions[name] == conditions[other])
            pairs |= {f"{name}/{other}": (arms[name], arms[other]) for name in alike}
    named = {f"{arm.name}/{arm.over}": (arm.name, arm.over) for arm in experiment.arms if arm.over is not None}
    return pairs | {name: (arms[arm], arms[over]) for name, (arm, over) in named.items() if {arm, over} <= set(arms)}


def _compare(over: list[Line], under: list[Line], ratio: bool) -> dict[str, Stats]:
    result: dict[str, Stats] = {}
    for measure in COMPARED:
        ours, theirs = ([line["measures"][measure] for line in own] for own in (over, under))
        result[measure] = _rounded(dict(zip(("mean", "low", "high"), compare_means(ours, theirs, ratio), strict=True)))
    return result


def protocol_of(experiment: Experiment, arms: dict[str, list[Line]], lines: Sequence[Line]) -> dict[str, Any]:
    """How it was made."""
    first = lines[0]
    wanted = {arm.name: experiment.seeds_of(arm) for arm in experiment.arms}
    return {
        "experiment": experiment.full_name,
        "question": experiment.question,
        "command": command_of(experiment),
        "preset": "smoke" if experiment.form == "smoke" else experiment.preset,
        "baseline": experiment.baseline,
        BEST: experiment.best,
        "seeds": {name: [line["seed"] for line in own] for name, own in arms.items()},
        "seeds_wanted": wanted,
        "total_steps": {name: steps for name, (steps, _) in _conditions(experiment).items()},
        "split": first["split"],
        "episodes": first["episodes"],
        "scenes": first["scenes"],
        "actions": "sampled, after the last update",
        "intervals": {
            "arms": "95 %, Student's t over seeds",
            "ratios, differences": "95 %, percentile bootstrap over seeds, each arm's drawn independently",
        },
        "planners": {name: own[0]["planner"] for name, own in arms.items()},
        "privileged_planner": {name: own[0]["privileged"] for name, own in arms.items()},
        "same_rgb_features": _same_features(experiment),
        "overrides": {
            "all": [*experiment.overrides, *experiment.changed],
            **{arm.name: list(arm.overrides) for arm in experiment.arms},
            **{row.name: list(row.overrides) for row in experiment.rows},
        },
        "versions": sorted({f"{line['version']} ({line['commit']})" for line in lines}),
        "wall_seconds": sum(line["wall_seconds"] for line in lines),
    }


def command_of(experiment: Experiment) -> str:
    """What to type to get the same again."""
    form = f" --{experiment.form}" if experiment.form else ""
    changed = "".join(f" --set {shlex.quote(override)}" for override in experiment.changed)
    return f"thinknav {'reproduce' if experiment.reproduces else 'experiment'} {experiment.name}{form}{changed}"


def _conditions(experiment: Experiment) -> dict[str, tuple[int, bool]]:
    """Of each arm, what an arm it is compared with must have too: steps of training, and a sensor that not all have."""
    configs = {arm.name: experiment.config(arm, 0) for arm in experiment.arms}
    return {name: (config.total_steps, config.policy.obstacle_memory) for name, config in configs.items()}


def _same_features(experiment: Experiment) -> bool:
    """Whether all arms see RGB through the same eyes, so that none has a gain from its eyes alone."""
    seen = {
        (config.policy.image_encoder, config.policy.channels, config.policy.visual_size, config.env.width)
        for config in (experiment.config(arm, 0) for arm in experiment.arms)
    }
    return len(seen) == 1
