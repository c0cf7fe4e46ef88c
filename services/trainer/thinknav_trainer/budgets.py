"""A checkpoint at several budgets of thinks: evaluate each, and write the curves down.

    points = evaluate_budgets(path, [WhenToThink(bias=b) for b in (-2, 0, 2)], folder, Interruption())
    write_curves(folder, protocol, [Curve.of("its own choice", points)])

Knows evaluations and curves; nothing of how a policy is played.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from thinknav_trainer.budget_curve import Curve, Point, gains
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import parse_config
from thinknav_trainer.episode_sets import EpisodeSet
from thinknav_trainer.files import replace_text
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.when_to_think import WhenToThink
from thinknav_trainer.workflow import evaluate_checkpoint


def evaluate_budgets(
    checkpoint: Path,
    manners: Sequence[WhenToThink],
    folder: Path,
    interrupted: Interruption,
    planner_url: str | None = None,
    split: str = "held_out",
    elsewhere: EpisodeSet | None = None,
) -> list[Point]:
    """Play the same episodes in each manner, in turn; each evaluation lies in a folder of its own in `folder`.

    elsewhere: episodes in the place of a split of its run. Points that the user's interruption prevented are missing.
    Raises ConfigError for a manner that the policy cannot take, before anything is played.
    """
    config = parse_config(Checkpoint.load(checkpoint).config)
    for manner in manners:
        manner.configure(config)
    homes = make_homes(config) if elsewhere is None else None
    points = []
    for manner in manners:
        output = folder / manner.name
        _, records = evaluate_checkpoint(
            checkpoint,
            split,
            interrupted,
            planner_url,
            output=output,
            homes=homes,
            elsewhere=elsewhere,
            when=manner,
        )
        if interrupted.requested:
            break
        points.append(Point(manner.name, records))
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
