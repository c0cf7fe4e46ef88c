"""A checkpoint at several budgets of thinks: evaluate each, and write the curves down.

    manners = {"its own choice": [WhenToThink(bias=b) for b in (-2, 0, 2)]}
    points = evaluate_budgets(path, manners, own_split(config, "held_out"), folder, Interruption())
    write_curves(folder, protocol, [Curve.of(name, found) for name, found in points.items()])

Knows evaluations and curves; nothing of how a policy is played.
"""

import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from thinknav_trainer.budget_curve import Curve, Point, gains
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import parse_config
from thinknav_trainer.episode_sets import EpisodeSet
from thinknav_trainer.files import replace_text
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.when_to_think import WhenToThink
from thinknav_trainer.workflow import evaluate_checkpoint


def evaluate_budgets(
    checkpoint: Path,
    manners: Mapping[str, Sequence[WhenToThink]],
    played: EpisodeSet,
    folder: Path,
    interrupted: Interruption,
    planner_url: str | None = None,
) -> dict[str, list[Point]]:
    """Play the same episodes in each manner of each curve, in turn: the points by curve.

    Each evaluation lies in a folder of its own in `folder`. Points that the user's interruption prevented are missing.
    Raises ConfigError for a manner that the policy cannot take, before anything is played.
    """
    config = parse_config(Checkpoint.load(checkpoint).config)
    for manner in itertools.chain(*manners.values()):
        manner.configure(config)
    points: dict[str, list[Point]] = {curve: [] for curve in manners}
    for curve, manner in ((curve, manner) for curve, each in manners.items() for manner in each):
        _, records = evaluate_checkpoint(
            checkpoint,
            played.name,
            interrupted,
            planner_url,
            output=folder / manner.name,
            elsewhere=played,
            when=manner,
        )
        if interrupted.requested:
            break
        points[curve].append(Point(manner.name, records))
    return points


def write_curves(folder: Path, protocol: dict[str, Any], curves: Sequence[Curve]) -> Path:
    """`curves.json` (every point, and what the first curve gains on the others) and `curves.svg`; the latter's path."""
    from thinknav_trainer.report.budget_figure import draw_budget_curves  # matplotlib is slow to import

    first, *others = curves
    result = {
        "protocol": protocol,
        "curves": {curve.name: curve.table() for curve in curves},
        "gains": {other.name: gains(first, other) for other in others},
    }
    replace_text(folder / "curves.json", json.dumps(result, indent=2) + "\n")
    path = folder / "curves.svg"
    replace_text(path, draw_budget_curves(curves, WhenToThink().name) + "\n")
    return path
