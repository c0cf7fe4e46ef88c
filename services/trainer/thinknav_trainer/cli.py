"""The `thinknav` command. Reads arguments, calls the parts in order, turns errors into one line and an exit status.

Exit status: 0 done, 1 failed, 2 something the user gave cannot be used, 130 Ctrl-C.
"""

import logging
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.logging import RichHandler
from rich.table import Table

from thinknav_proto import PlannerError
from thinknav_sim.episodes import EpisodeError
from thinknav_sim.render import RendererUnavailable
from thinknav_sim.scene import SceneError
from thinknav_trainer.checkpoint import CheckpointError
from thinknav_trainer.commands import bench, episodes, homes, scenes
from thinknav_trainer.config import ConfigError, change_config, load_config, presets
from thinknav_trainer.demo import run_demo
from thinknav_trainer.evaluate import EpisodeRecord, summarize
from thinknav_trainer.interrupt import interruption
from thinknav_trainer.ppo import TrainingDiverged
from thinknav_trainer.report import write_report
from thinknav_trainer.run import RunError, read_config
from thinknav_trainer.service_process import ServiceError
from thinknav_trainer.workflow import evaluate_checkpoint, train_run

# What a user, or the world, can do wrong; anything else is our mistake and shows its traceback.
USAGE_ERRORS = (ConfigError, RunError, CheckpointError, SceneError, EpisodeError)
FAILURES = (PlannerError, ServiceError, RendererUnavailable, TrainingDiverged)

app = typer.Typer(
    help="Robots that find objects in homes, and ask for a hint when a hint is worth its cost.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(episodes.app, name="episodes")
app.add_typer(homes.app, name="homes")
app.add_typer(bench.app, name="bench")
app.add_typer(scenes.app, name="scenes")

Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="e.g. --set ppo.lr=1e-4")]
Preset = Annotated[str, typer.Option(help=f"one of: {', '.join(presets())}")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="a YAML file over the preset")]
Planner = Annotated[str | None, typer.Option(help="URL of the planning service, over the configuration's")]
Runs = Annotated[Path, typer.Option(help="folder of all runs")]


@app.command()
def train(
    name: Annotated[str, typer.Option(help="of the run: its folder in --runs")],
    preset: Preset = "cpu",
    config_file: ConfigFile = None,
    overrides: Overrides = None,
    planner: Planner = None,
    runs: Runs = Path("runs"),
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run of this name")] = False,
) -> None:
    """Train a policy. Needs a planning service (thinknav-server serve), but for think.strategy=never.

    With --resume the run's own configuration takes the place of the preset.
    """
    if resume:
        config = change_config(read_config(runs / name), config_file, overrides or ())
    else:
        config = load_config(preset, config_file, overrides or ())
    config = config.with_planner(planner)
    with interruption() as interrupted:
        path = train_run(runs / name, config, interrupted, resume)
    Console().print(f"checkpoint: {path}", soft_wrap=True)
    raise typer.Exit(interrupted.exit_code)


@app.command("eval")
def evaluate(
    checkpoint: Annotated[Path, typer.Argument(help="a checkpoint file")],
    split: Annotated[str, typer.Option(help="held_out or train")] = "held_out",
    planner: Planner = None,
    greedy: Annotated[bool, typer.Option("--greedy", help="take the likeliest action instead of sampling")] = False,
    output: Annotated[Path | None, typer.Option(help="folder of the result; default: beside the checkpoints")] = None,
) -> None:
    """Evaluate a checkpoint on every episode of a split."""
    with interruption() as interrupted:
        folder, records = evaluate_checkpoint(checkpoint, split, interrupted, planner, greedy, output)
    if not interrupted.requested:
        print_summary(f"{split} episodes of {checkpoint}", records)
        Console().print(f"result: {folder / 'result.json'}", soft_wrap=True)
    raise typer.Exit(interrupted.exit_code)


@app.command()
def report(run: Annotated[Path, typer.Argument(help="the folder of a run, evaluated before")]) -> None:
    """Write report.html into a run's folder."""
    Console().print(f"report: {write_report(run)}", soft_wrap=True)


@app.command()
def demo(
    runs: Runs = Path("runs"),
    preset: Preset = "demo",
    overrides: Overrides = None,
) -> None:
    """Start a planning service, train, evaluate before and after, and write runs/demo/report.html."""
    config = load_config(preset, None, overrides or ())
    with interruption() as interrupted:
        page = run_demo(runs / "demo", config, interrupted)
    if page is not None:
        Console().print(f"report: {page}", soft_wrap=True)
    raise typer.Exit(interrupted.exit_code)


def print_summary(title: str, records: list[EpisodeRecord]) -> None:
    """A table for people: mean and 95 % interval over episodes."""
    table = Table("measure", "mean", "95 % interval", title=f"{len(records)} {title}", title_justify="left")
    for name, row in summarize(records).items():
        table.add_row(name, f"{row['mean']:.3f}", f"{row['low']:.3f} to {row['high']:.3f}")
    Console().print(table)


def main() -> None:
    """Entry point of the command: errors become one line on stderr."""
    console = Console(stderr=True)
    if console.is_terminal:
        logging.basicConfig(
            level=logging.INFO, format="%(message)s", handlers=[RichHandler(console=console, show_path=False)]
        )
    else:
        logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("httpx").setLevel(logging.WARNING)
    try:
        app()
    except USAGE_ERRORS as error:
        _fail(error, 2)
    except FAILURES as error:
        _fail(error, 1)
    except KeyboardInterrupt:
        _fail(KeyboardInterrupt("interrupted"), 130)


def _fail(error: BaseException, status: int) -> None:
    sys.stderr.write(f"thinknav: {error}\n")
    sys.exit(status)
