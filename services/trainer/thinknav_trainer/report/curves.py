"""Learning curves as SVG. Knows metrics by name; nothing of runs and pages."""

import io
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib.figure
import numpy as np

INK = "#26323d"
GRID = "#e3e8ed"
COLORS = ("#2f6db3", "#d9822b", "#3f9a5f", "#a64ca6", "#c94040", "#6b7785")
SMOOTHING_UPDATES = 7


@dataclass(frozen=True)
class Panel:
    """One chart: a title and the metrics drawn in it, (name in the log, label)."""

    title: str
    lines: tuple[tuple[str, str], ...]
    share: bool = False  # lies between 0 and 1


def panels(metrics: Sequence[dict[str, float]]) -> list[Panel]:
    """What there is to draw; think rate and reward terms only where they were logged."""
    terms = sorted({name for row in metrics for name in row if name.startswith("reward/")})
    wanted = [
        Panel("Success", (("success", "success"),), share=True),
        Panel("SPL and SoftSPL", (("spl", "SPL"), ("soft_spl", "SoftSPL")), share=True),
        Panel("Distance to goal at the end, m", (("distance_to_goal", "distance"),)),
        Panel("Think rate (share of steps)", (("think_rate", "think rate"),)),
        Panel("Loops and turns for nothing (shares)", (("think_loops", "loops"), ("spinning", "turns")), share=True),
        Panel("Reward of an episode, by term", tuple((term, term.removeprefix("reward/")) for term in terms)),
        Panel("Steps of an episode", (("episode_steps", "steps"),)),
    ]
    logged = {name for row in metrics for name in row}
    return [panel for panel in wanted if any(name in logged for name, _ in panel.lines)]


def draw_curve(metrics: Sequence[dict[str, float]], panel: Panel) -> str:
    """One chart as an SVG element."""
    figure = matplotlib.figure.Figure(figsize=(4.4, 2.7), layout="constrained")
    axes = figure.subplots()
    for color, (name, label) in zip(COLORS, panel.lines, strict=False):
        rows = [(row["steps"], row[name]) for row in metrics if name in row]
        if not rows:
            continue
        steps, values = np.array(rows, float).T
        if len(values) > 2 * SMOOTHING_UPDATES:
            axes.plot(steps, values, color=color, alpha=0.25, linewidth=0.8)
        axes.plot(steps, smooth(values), color=color, linewidth=1.8, label=label)
    axes.set_title(panel.title, loc="left", fontsize=10, color=INK, fontweight="bold")
    axes.set_xlabel("environment steps", fontsize=8, color=INK)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1000:g}k")
    axes.tick_params(labelsize=8, colors=INK)
    axes.grid(color=GRID)
    axes.spines[["top", "right"]].set_visible(False)
    if panel.share:
        axes.set_ylim(-0.02, 1.02)
    if len(panel.lines) > 1:
        axes.legend(fontsize=7, frameon=False)
    return to_svg(figure)


def smooth(
    values: np.ndarray[tuple[int], np.dtype[np.float64]],
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Centred moving average that narrows towards the ends."""
    half = min(SMOOTHING_UPDATES // 2, len(values) // 8)
    return np.array([values[max(0, i - half) : i + half + 1].mean() for i in range(len(values))])


def to_svg(figure: matplotlib.figure.Figure) -> str:
    """The figure's <svg> element, with its text as text."""
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "font.family": "sans-serif"}):
        figure.savefig(buffer, format="svg")
    svg = buffer.getvalue()
    return svg[svg.index("<svg") :]
