"""The figure of SPL against calls per episode. Knows curves; nothing of how they were made."""

from collections.abc import Sequence

import matplotlib.figure
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator

from thinknav_trainer.budget_curve import Curve
from thinknav_trainer.report.curves import COLORS, GRID, INK, to_svg

_CALLS = (0, 0.5, 1, 2, 5, 10, 20, 50, 100, 200)  # ticks


def draw_budget_curves(curves: Sequence[Curve], as_learnt: str, measure: str = "spl", label: str = "SPL") -> str:
    """All curves as one SVG element, with 95 % intervals over episodes; the point named `as_learnt` is ringed."""
    figure = matplotlib.figure.Figure(figsize=(5.6, 3.6), layout="constrained")
    axes = figure.subplots()
    for color, curve in zip(COLORS, curves, strict=False):
        rows = curve.table()
        calls = [row["thinks"]["mean"] for row in rows]
        worth = [row[measure]["mean"] for row in rows]
        low, high = ([row[measure][side] for row in rows] for side in ("low", "high"))
        axes.vlines(calls, low, high, color=color, alpha=0.45, linewidth=1.2)
        axes.plot(calls, worth, color=color, marker="o", markersize=4, linewidth=1.6, label=curve.name)
        for row, x, y in zip(rows, calls, worth, strict=True):
            if row["name"] == as_learnt:
                axes.plot([x], [y], "o", markersize=10, fillstyle="none", color=color, label="as it learnt to think")
    axes.set_xlabel("calls of the planner in an episode", fontsize=9, color=INK)
    axes.set_title(f"{label} against calls", loc="left", fontsize=10, color=INK, fontweight="bold")
    _scale_calls(axes)
    axes.set_ylim(bottom=0)
    axes.tick_params(labelsize=8, colors=INK)
    axes.grid(color=GRID)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=8, frameon=False, loc="lower right")
    return to_svg(figure)


def _scale_calls(axes: Axes) -> None:
    """Linear to one call, logarithmic above: a policy that has learnt when to think is at the far left."""
    most = axes.get_xlim()[1]
    axes.set_xscale("symlog", linthresh=1, linscale=0.6)
    axes.xaxis.set_major_locator(FixedLocator([tick for tick in _CALLS if tick <= most]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlim(-0.04, most)
