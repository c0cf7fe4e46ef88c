"""An experiment's result as a page: absolute numbers, each arm without its thoughts, ratios, what the return was made
of, and how it was made. Knows the form that `summary` gives; computes nothing but shares.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from thinknav_trainer.experiments.experiment import Experiment
from thinknav_trainer.experiments.summary import BEST, Stats

_ABSOLUTE = {
    "success": "success",
    "spl": "SPL",
    "soft_spl": "SoftSPL",
    "distance_to_goal": "distance to goal, m",
    "sot": "SOT",
    "steps": "steps",
    "think_rate": "think rate",
    "calls_per_success": "calls per success",
}
_FARMING = {"think_loops": "think loops", "spinning": "turns for nothing", "agreement_share": "agreement share"}
_WITH_INTERVAL = ("success", "spl")
_FIGURES = {
    "curves": "Learning curves of {}: mean and 95 % band over seeds",
    "quality": "SPL in {} against the share of the planner's answers that are redrawn at random",
}


def markdown(experiment: Experiment, result: dict[str, Any], figures: Mapping[str, str]) -> str:
    """The page. figures: files beside it, by kind."""
    protocol = result["protocol"]
    parts = [
        f"# {protocol['experiment']}",
        protocol["question"],
        f"```console\n{protocol['command']}\n```",
        *_warnings(protocol),
        _absolute(result),
        *_ratios(result),
        *_replaced(result),
        *_returns(result),
    ]
    parts += [f"![{_FIGURES[kind].format(experiment.name)}]({file})" for kind, file in figures.items()]
    parts += ["## Protocol", "\n".join(f"- {note}" for note in _notes(protocol)), _overrides(protocol)]
    return "\n\n".join(parts) + "\n"


def _warnings(protocol: dict[str, Any]) -> list[str]:
    forms = {
        "smoke": "**A smoke test**: seconds of training, so that nothing is learnt and no number means anything.",
        "quick": "**The quick form**: fewer arms, seeds, steps and homes; the story, and no proof of it.",
    }
    found = [words for form, words in forms.items() if protocol["experiment"].endswith(f"-{form}")]
    short = [
        f"{name} ({len(protocol['seeds'].get(name, ()))} of {wanted})"
        for name, wanted in protocol["seeds_wanted"].items()
        if len(protocol["seeds"].get(name, ())) < wanted
    ]
    return found + ([f"**Not all is done yet**; seeds so far: {', '.join(short)}."] if short else [])


def _absolute(result: dict[str, Any]) -> str:
    rows = []
    for name, measures in result["arms"].items():
        label = f"{name} (= {BEST})" if name == result["protocol"][BEST] else name
        cells = [_cell(measures.get(measure), measure in _WITH_INTERVAL) for measure in _ABSOLUTE]
        rows.append([label, str(len(result["protocol"]["seeds"][name])), *cells])
    for name, values in result["agents"].items():
        rows.append([f"*{name}*", "no training", *(number(values.get(measure)) for measure in _ABSOLUTE)])
    return table(["arm", "seeds", *_ABSOLUTE.values()], rows)


def _ratios(result: dict[str, Any]) -> list[str]:
    rows = []
    for name, ratios in result["ratios"].items():
        differences = result["differences"][name]
        cells = [_cell(part[measure], True) for measure in ("spl", "success") for part in (ratios, differences)]
        rows.append([name, *cells])
    titles = ["", "SPL, ratio", "SPL, difference", "success, ratio", "success, difference"]
    return ["## Over the baseline, and one arm over another", table(titles, rows)] if rows else []


def _replaced(result: dict[str, Any]) -> list[str]:
    rows = []
    for name in result["masked"]:
        told = result["arms"][name], result["masked"][name], result["shuffled"].get(name, {})
        rows.append([name, *(_cell(part.get(m), True) for m in ("spl", "success") for part in told)])
    titles = ["arm"] + [f"{m}{how}" for m in ("SPL", "success") for how in ("", ", masked", ", another's")]
    return ["## Without its thoughts", table(titles, rows)] if rows else []


def _returns(result: dict[str, Any]) -> list[str]:
    terms = sorted({m for measures in result["arms"].values() for m in measures if m.startswith("reward/")})
    rows = []
    for name, measures in result["arms"].items():
        means = {term: measures[term]["mean"] for term in terms if term in measures}
        total = sum(map(abs, means.values())) or 1.0
        shares = [f"{means[term]:+.2f} ({abs(means[term]) / total:.0%})" if term in means else "" for term in terms]
        rows.append([name, *shares, *(_cell(measures.get(measure)) for measure in _FARMING)])
    titles = ["arm", *(term.removeprefix("reward/") for term in terms), *_FARMING.values()]
    words = "Sums of an episode, and the share of each term in the sum of their absolute values; "
    link = "and whether it was farmed ([metrics](../metrics.md#is-a-bonus-farmed))."
    return ["## What the return was made of", words + link, table(titles, rows)] if rows else []


def _notes(protocol: dict[str, Any]) -> Iterable[str]:
    yield f"Steps of training: {_by_value({name: f'{steps:,}' for name, steps in protocol['total_steps'].items()})}."
    scenes = protocol["scenes"]
    where = ", ".join(scenes) if len(scenes) <= 6 else f"{len(scenes)} homes"
    episodes = f"{protocol['episodes']} episodes ({protocol['split']}) in {where}"
    yield f"Evaluated on {episodes}; actions {protocol['actions']}."
    yield f"Intervals of arms: {protocol['intervals']['arms']}; of ratios and differences: " + (
        f"{protocol['intervals']['ratios, differences']}."
    )
    planners = {name: planner or "no planner" for name, planner in protocol["planners"].items()}
    yield f"Planners: {_by_value(planners)}."
    privileged = [name for name, told in protocol["privileged_planner"].items() if told]
    yield f"The planner is privileged in: {', '.join(privileged) or 'no arm'}."
    yield (
        "All arms see RGB through the same eyes."
        if protocol["same_rgb_features"]
        else ("The arms do NOT all see RGB through the same eyes.")
    )
    hours = protocol["wall_seconds"] / 3600
    yield f"ThinkNav {', '.join(protocol['versions'])}; {hours:.1f} hours of processes in all."


def _overrides(protocol: dict[str, Any]) -> str:
    """What each arm sets, over the preset."""
    rows = [[name, " ".join(f"`{one}`" for one in own) or "nothing"] for name, own in protocol["overrides"].items()]
    return table(["", f"over the preset `{protocol['preset']}`"], rows)


def _by_value(named: dict[str, str]) -> str:
    """Names by what they have; what most have, by that alone."""
    values = list(named.values())
    usual = max(values, key=values.count, default="none")
    others = [f"{name}: {value}" for name, value in named.items() if value != usual]
    return usual if not others else f"{usual}; but {', '.join(others)}"


def table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _cell(row: Stats | None, interval: bool = False) -> str:
    if row is None or row["mean"] is None:
        return "–"
    if not interval or (row["low"] is None and row["high"] is None):
        return number(row["mean"])
    low, high = ("∞" if bound is None else number(bound) for bound in (row["low"], row["high"]))
    return f"{number(row['mean'])} ({low} to {high})"


def number(value: float | None) -> str:
    """A number as tables show it; a dash for none."""
    if value is None:
        return "–"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"
