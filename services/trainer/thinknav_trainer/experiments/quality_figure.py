"""What a planner's quality is worth: SPL against the share of its answers that are redrawn at random, of the arms that
ask the privileged planner; as they are, and without their thoughts. Knows the lines of a ledger; nothing of runs.
"""

from collections.abc import Sequence
from statistics import fmean

import matplotlib.figure
from matplotlib.axes import Axes

from thinknav_trainer.experiments.drawing import COLORS, dress, saved
from thinknav_trainer.experiments.experiment import Experiment
from thinknav_trainer.experiments.ledger import Line
from thinknav_trainer.experiments.summary import lines_of

_FEWEST_ERRORS = 2  # of a line

_BySeed = dict[float, list[float]]


def draw_quality(experiment: Experiment, lines: Sequence[Line]) -> dict[str, bytes] | None:
    """The figure as "svg" and as "png"; None of an experiment without a planner of several qualities."""
    told, masked = _by_error(experiment, lines)
    if len(told) < _FEWEST_ERRORS:
        return None
    figure = matplotlib.figure.Figure(figsize=(6.6, 4.2), layout="constrained")
    axes = figure.subplots()
    _draw(axes, told, "as it is", COLORS[2], "-")
    _draw(axes, masked, "with its thoughts masked", COLORS[1], "--")
    baseline = [arm for arm in experiment.arms if arm.name == experiment.baseline]
    if own := [line for arm in baseline for line in lines_of(arm, lines)]:
        mean = fmean(line["measures"]["spl"] for line in own)
        axes.axhline(mean, color=COLORS[0], linestyle=":", linewidth=2, label=f"{experiment.baseline}: no planner")
    dress(axes, "SPL, by how often the planner is right")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axes.set_xlim(-0.02, max(told) + 0.02)
    axes.set_ylim(-0.02, 1.02)
    axes.set_xlabel("of the planner's answers, redrawn at random (line: mean; dots: seeds)", fontsize=9)
    axes.legend(frameon=False, fontsize=9)
    return {ending: saved(figure, ending) for ending in ("svg", "png")}


def _by_error(experiment: Experiment, lines: Sequence[Line]) -> tuple[_BySeed, _BySeed]:
    """SPL of the seeds, as they are and masked, by the share of answers that are redrawn."""
    told: _BySeed = {}
    masked: _BySeed = {}
    for arm in experiment.arms:
        planner = experiment.config(arm, 0).planner
        own = lines_of(arm, lines)
        is_heard = planner.control == "none" and not planner.privileged.shuffled
        if planner.url == "privileged" and is_heard and own:
            error = planner.privileged.error
            told[error] = [line["measures"]["spl"] for line in own]
            masked[error] = [line["masked"]["spl"] for line in own if line.get("masked")]
    return dict(sorted(told.items())), dict(sorted(masked.items()))


def _draw(axes: Axes, by_error: _BySeed, label: str, color: str, dashes: str) -> None:
    means = {error: fmean(values) for error, values in by_error.items() if values}
    axes.plot(list(means), list(means.values()), color=color, linestyle=dashes, linewidth=2, label=label)
    for error, values in by_error.items():
        axes.plot([error] * len(values), values, "o", color=color, markersize=4, alpha=0.6)
