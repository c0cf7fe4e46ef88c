"""All that is written down of an experiment: `NAME.json`, `NAME.md`, and figures as `NAME-….svg` and `.png`."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from thinknav_trainer.experiments.experiment import Experiment
from thinknav_trainer.experiments.figure import draw_curves
from thinknav_trainer.experiments.ledger import Line
from thinknav_trainer.experiments.markdown import markdown
from thinknav_trainer.experiments.quality_figure import draw_quality
from thinknav_trainer.experiments.summary import summarize
from thinknav_trainer.files import replace_text, replacing

FIGURES = {"curves": draw_curves, "quality": draw_quality}


def write_pages(experiment: Experiment, lines: Sequence[Line], folder: Path) -> Path:
    """Into a folder, from a ledger's lines, of which there is at least one; the path of the table.

    An arm that has fewer seeds than the experiment wants says so.
    """
    name = experiment.full_name
    result = summarize(experiment, lines)
    replace_text(folder / f"{name}.json", laid_out(result) + "\n")
    figures = {}
    for kind, draw in FIGURES.items():
        for ending, picture in (draw(experiment, lines) or {}).items():
            with replacing(folder / f"{name}-{kind}.{ending}") as file:
                file.write(picture)
            figures[kind] = f"{name}-{kind}.svg"
    page = folder / f"{name}.md"
    replace_text(page, markdown(experiment, result, figures))
    return page


def laid_out(value: Any, depth: int = 3) -> str:
    """JSON with a line for each entry down to a depth, and those below in one line: small, and good to compare."""
    if depth == 0 or not isinstance(value, dict) or not value:
        return json.dumps(value, allow_nan=False)
    indent = "  " * (4 - depth)
    rows = [f"{indent}{json.dumps(name)}: {laid_out(inner, depth - 1)}" for name, inner in value.items()]
    return "{\n" + ",\n".join(rows) + "\n" + indent[2:] + "}"
