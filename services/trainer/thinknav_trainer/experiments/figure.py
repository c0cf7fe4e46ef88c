"""Learning curves of an experiment: success, SPL, SoftSPL and distance to goal against environment steps, as the
paper's figures 5 and 6 have them, and how often an arm thinks, and does so in loops; the mean over seeds, and its 95 %
band (Student's).

Knows the lines of a ledger; nothing of runs.
"""

from collections.abc import Sequence
from typing import Any

import matplotlib
import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from thinknav_trainer.experiments.drawing import COLORS, INK, dress, saved
from thinknav_trainer.experiments.experiment import Experiment
from thinknav_trainer.experiments.ledger import Line
from thinknav_trainer.experiments.summary import lines_of
from thinknav_trainer.statistics import student_interval

PANELS = {
    "success": "Success",
    "spl": "SPL",
    "think_rate": "Thinks, a share of the steps",
    "soft_spl": "SoftSPL",
    "distance_to_goal": "Distance to goal at the end, m",
    "think_loops": "Steps in think–agree loops, a share",
}
MOST_LINES = 8
DASHES: tuple[Any, ...] = ("-", "-", "-", "--", "--", "-.", "-.", ":")
_POINTS = 40
_FEWEST_SEEDS = 3  # of a band: that of two is wider than any picture

_Curve = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]


def draw_curves(experiment: Experiment, lines: Sequence[Line]) -> dict[str, bytes] | None:
    """The figure as "svg" and as "png"; None where no drawn arm has a curve."""
    arms = {arm.name: own for arm in experiment.arms if (own := _with_curves(lines_of(arm, lines)))}
    drawn = [name for name in (experiment.drawn or tuple(arms))[:MOST_LINES] if name in arms]
    if not drawn:
        return None
    figure = matplotlib.figure.Figure(figsize=(13.2, 6.6), layout="constrained")
    grid = figure.subplots(2, 3, sharex=True)
    for axes, (measure, title) in zip(grid.flat, PANELS.items(), strict=True):
        for place, name in enumerate(drawn):
            _draw(axes, _over_seeds(arms[name], measure), COLORS[place], DASHES[place])
        dress(axes, title)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1000:g}k")
        axes.set_xlim(left=0)
        if measure == "distance_to_goal":
            axes.set_ylim(bottom=0)
        else:
            axes.set_ylim(-0.02, 1.02)
    for axes in grid[1]:
        axes.set_xlabel("steps of training (mean; 95 % band of three seeds or more)", fontsize=9, color=INK)
    handles = [
        matplotlib.lines.Line2D([], [], color=COLORS[place], linestyle=DASHES[place], linewidth=2.2)
        for place in range(len(drawn))
    ]
    labels = [_label(name, arms[name], experiment) for name in drawn]
    figure.legend(
        handles, labels, loc="outside upper center", ncols=min(5, len(drawn)), frameon=False, fontsize=9, handlelength=3
    )
    return {ending: saved(figure, ending) for ending in ("svg", "png")}


def _with_curves(lines: Sequence[Line]) -> list[Line]:
    return [line for line in lines if len(line["curve"]["steps"]) > 1]


def _label(name: str, lines: Sequence[Line], experiment: Experiment) -> str:
    best = ", agent-best" if name == experiment.best else ""
    return f"{name}{best} ({len(lines)} seed{'s' if len(lines) > 1 else ''})"


def _over_seeds(lines: Sequence[Line], measure: str) -> _Curve:
    """Steps, means, and the band (2, points), none of fewer than three seeds; as far as all seeds have come."""
    curves = []
    for line in lines:
        steps = np.array(line["curve"]["steps"], float)
        values = np.array([np.nan if value is None else value for value in line["curve"][measure]], float)
        there = ~np.isnan(values)
        if there.any():
            curves.append((steps[there], values[there]))
    if not curves:  # no episode ended in all of the training
        return np.empty(0), np.empty(0), None
    begin, end = max(steps[0] for steps, _ in curves), min(steps[-1] for steps, _ in curves)
    common = np.linspace(begin, end, _POINTS)
    rows = np.stack([np.interp(common, steps, values) for steps, values in curves])
    if len(rows) < _FEWEST_SEEDS:
        return common, rows.mean(axis=0), None
    band = np.array([student_interval(column.tolist()) for column in rows.T]).T
    return common, rows.mean(axis=0), band


def _draw(axes: Axes, curve: _Curve, color: str, dashes: str) -> None:
    steps, means, band = curve
    if band is not None:
        axes.fill_between(steps, band[0], band[1], color=color, alpha=0.13, linewidth=0)
    axes.plot(steps, means, color=color, linestyle=dashes, linewidth=2)
