"""What the figures of experiments have in common: colours, how axes are dressed, the same bytes for the same figure."""

import io

import matplotlib
import matplotlib.figure
from matplotlib.axes import Axes

# Okabe and Ito's, which people tell apart who see colours otherwise.
COLORS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8a7d00")
INK, GRID = "#26323d", "#e3e8ed"


def dress(axes: Axes, title: str) -> None:
    """A title to the left, a quiet grid, and no more frame than two axes."""
    axes.set_title(title, loc="left", fontsize=11, color=INK, fontweight="bold")
    axes.tick_params(labelsize=9, colors=INK)
    axes.grid(color=GRID)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def saved(figure: matplotlib.figure.Figure, ending: str) -> bytes:
    """A figure as "svg" or "png"."""
    buffer = io.BytesIO()
    metadata = {"Date": None} if ending == "svg" else {"Software": None}
    with matplotlib.rc_context({"svg.fonttype": "none", "font.family": "sans-serif", "svg.hashsalt": "thinknav"}):
        figure.savefig(buffer, format=ending, dpi=130, metadata=metadata)
    return buffer.getvalue()
