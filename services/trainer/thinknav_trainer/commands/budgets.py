"""`thinknav budgets`: one policy at several budgets of thinks, and the curve of it."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, TypeVar

import typer
from rich.console import Console
from rich.table import Table

from thinknav_trainer.budget_curve import Curve, Point, gains
from thinknav_trainer.budgets import evaluate_budgets, write_curves
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.commands.evaluate import (
    Episodes,
    EpisodesFile,
    HomesOption,
    Planner,
    Scenes,
    Split,
    Where,
    refuse_unused,
)
from thinknav_trainer.commands.options import check_folder
from thinknav_trainer.compare import find_evaluation, require_same_episodes
from thinknav_trainer.config import ConfigError, parse_config
from thinknav_trainer.episode_sets import EpisodeSet
from thinknav_trainer.interrupt import interruption
from thinknav_trainer.records import read_evaluation
from thinknav_trainer.when_to_think import WhenToThink
from thinknav_trainer.workflow import evaluation_folder, own_split

OWN, CLOCK, OTHERS = "own choice", "clock", "others"

Number = TypeVar("Number", int, float)

Biases = Annotated[str, typer.Option(help="added to the logit of think, a point each; 0: as it learnt to")]
Every = Annotated[str, typer.Option(help="steps from one think to the next, a point each; empty: none")]
Against = Annotated[
    list[Path] | None,
    typer.Option(help="an evaluation of the same episodes, or a run with one: a point of a curve more"),
]
Output = Annotated[Path | None, typer.Option(help="folder of the results; default: budgets/ of the run")]


def budgets(
    context: typer.Context,
    checkpoint: Annotated[Path, typer.Argument(help="a checkpoint file")],
    biases: Biases = "-20,-4,-2,-1,0,1,2",
    every: Every = "5,10,20,40",
    against: Against = None,
    planner: Planner = None,
    output: Output = None,
    homes: HomesOption = None,
    episodes: Episodes = 200,
    episodes_file: EpisodesFile = None,
    scenes: Scenes = None,
    split: Split = "held_out",
) -> None:
    """Evaluate a policy at several budgets of thinks: SPL against calls, by its own choice and by the clock."""
    manners = {
        OWN: [WhenToThink(bias=bias) for bias in _numbers("--biases", biases, float)],
        CLOCK: [WhenToThink(every=steps) for steps in _numbers("--every", every, int)],
    }
    if not manners[OWN]:
        raise ConfigError("--biases names no point")
    if any(when.every is not None and when.every < 1 for when in manners[CLOCK]):
        raise ConfigError("--every takes numbers of steps from 1 on")
    check_folder("--output", output)
    config = parse_config(Checkpoint.load(checkpoint).config)
    where = Where(homes, episodes_file, scenes, episodes)
    refuse_unused(context, where)
    played = own_split(config, split) if where.is_usual else where.open(config.env)
    others = _others(against or (), played)
    folder = output or evaluation_folder(checkpoint, played.name, "budgets")
    with interruption() as interrupted:
        points = evaluate_budgets(checkpoint, manners, played, folder, interrupted, planner)
    if not interrupted.requested:
        curves = [Curve.of(curve, found) for curve, found in {**points, OTHERS: others}.items() if found]
        protocol = {"checkpoint": str(checkpoint), "split": played.name, "episodes": len(played.episodes)}
        path = write_curves(folder, protocol, curves)
        Console(markup=False).print(_table(curves))
        typer.echo(f"curves: {path}")
    raise typer.Exit(interrupted.exit_code)


def _numbers(option: str, text: str, kind: Callable[[str], Number]) -> list[Number]:
    try:
        return [kind(part) for part in text.split(",") if part.strip()]
    except ValueError:
        raise ConfigError(f"{option} takes numbers separated by commas, not {text!r}") from None


def _others(paths: Sequence[Path], played: EpisodeSet) -> list[Point]:
    """Points of evaluations that are there, their records in the order of what is played. Raises ConfigError."""
    ours = [(episode.scene_name, episode.episode_id, episode.object_category) for episode in played.episodes]
    points = []
    for path in paths:
        records = read_evaluation(find_evaluation(path))[1]
        require_same_episodes("these points", set(ours), str(path), records)
        theirs = {record.episode: record for record in records}
        points.append(Point(path.name, [theirs[episode] for episode in ours]))
    return points


def _table(curves: Sequence[Curve]) -> Table:
    title = "calls and SPL of an episode, 95 % intervals over episodes; what its own choice has over the clock"
    table = Table(
        "curve", "point", "calls", "of steps", "success", "SPL", "over clock", title=title, title_justify="left"
    )
    own, clock = curves[0], next((curve for curve in curves if curve.name == CLOCK), None)
    above = {row["name"]: row for row in gains(own, clock)} if clock is not None else {}
    for curve in curves:
        for row in curve.table():
            spl, gain = row["spl"], above.get(row["name"])
            table.add_row(
                curve.name,
                row["name"],
                f"{row['thinks']['mean']:.1f}",
                f"{row['think_rate']['mean']:.1%}",
                f"{row['success']['mean']:.3f}",
                f"{spl['mean']:.3f}\n{spl['low']:.2f} to {spl['high']:.2f}",
                "" if gain is None else f"{gain['mean']:+.3f}\n{gain['low']:+.2f} to {gain['high']:+.2f}",
            )
    return table
