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

from thinknav_models.weights import WeightsError
from thinknav_proto import PlannerError
from thinknav_sim.episodes import EpisodeError
from thinknav_sim.render import RendererUnavailable
from thinknav_sim.scene import SceneError
from thinknav_trainer.checkpoint import CheckpointError
from thinknav_trainer.commands import (
    ask,
    bench,
    budgets,
    compare,
    episodes,
    evaluate,
    experiment,
    homes,
    models,
    scenes,
)
from thinknav_trainer.config import ConfigError, TrainConfig, change_config, load_config, presets
from thinknav_trainer.demo import run_demo
from thinknav_trainer.dumps import TrainingDiverged
from thinknav_trainer.interrupt import interruption
from thinknav_trainer.recording import RecordingError
from thinknav_trainer.redo import redo_dump
from thinknav_trainer.report import write_report
from thinknav_trainer.rewards import REWARD_SCHEMES
from thinknav_trainer.run import RunError, read_config
from thinknav_trainer.service_process import ServiceError
from thinknav_trainer.strategies import STRATEGIES
from thinknav_trainer.vision import EmbeddingSpaceError
from thinknav_trainer.workers import WorkerLost, join_workers, own_rank, started_by_torchrun, times_restarted
from thinknav_trainer.workflow import train_run

# What a user, or the world, can do wrong; anything else is our mistake and shows its traceback.
USAGE_ERRORS = (
    ConfigError,
    RunError,
    RecordingError,
    CheckpointError,
    SceneError,
    EpisodeError,
    EmbeddingSpaceError,
    WeightsError,
)
FAILURES = (PlannerError, ServiceError, RendererUnavailable, TrainingDiverged, WorkerLost)

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
app.command("ask")(ask.ask)
app.command("eval")(evaluate.evaluate)
app.command("budgets")(budgets.budgets)
app.command("compare")(compare.compare_runs)
app.command("experiment")(experiment.experiment)
app.command("reproduce")(experiment.reproduce)
app.add_typer(models.app, name="models")

Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="e.g. --set ppo.lr=1e-4")]
Preset = Annotated[str, typer.Option(help=f"one of: {', '.join(presets())}")]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="a YAML file over the preset")]
Planner = Annotated[str | None, typer.Option(help="URL of the planning service, over the configuration's")]
Strategy = Annotated[str | None, typer.Option(help=f"when to think, never or: {', '.join(STRATEGIES)}")]
Reward = Annotated[str | None, typer.Option(help=f"the reward scheme: {', '.join(REWARD_SCHEMES)}")]
Runs = Annotated[Path, typer.Option(help="folder of all runs")]


@app.command()
def train(
    name: Annotated[str, typer.Option(help="of the run: its folder in --runs")],
    preset: Preset = "cpu",
    config_file: ConfigFile = None,
    overrides: Overrides = None,
    strategy: Strategy = None,
    reward: Reward = None,
    planner: Planner = None,
    runs: Runs = Path("runs"),
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run of this name")] = False,
    replay: Annotated[Path | None, typer.Option(help="a run's folder: its recorded replies, no service")] = None,
) -> None:
    """Train a policy. Needs a planning service (thinknav-server serve), but for think.strategy=never.

    With --resume the run's own configuration takes the place of the preset; with --replay that of the recorded run.
    --strategy and --reward stand for --set think.strategy=… and think.reward=….
    Under torchrun several processes train one policy (docs/scaling.md), and go on by themselves where it restarts them.
    """
    if resume and replay:
        raise ConfigError("--replay repeats a run from its beginning: it does not go with --resume")
    if times_restarted() > 0 and replay is None:
        resume = resume or (runs / name / "config.yaml").exists()

    named = {"think.strategy": strategy, "think.reward": reward}
    changes = [f"{key}={value}" for key, value in named.items() if value is not None] + (overrides or [])

    def configure() -> TrainConfig:
        if resume or replay:
            config = change_config(read_config(replay or runs / name), config_file, changes)
        else:
            config = load_config(preset, config_file, changes)
        return config.with_planner(planner)

    with interruption() as interrupted, join_workers(configure) as (workers, config):
        path = train_run(runs / name, config, interrupted, resume, replay=replay, workers=workers)
    if workers.rank == 0:
        Console().print(f"checkpoint: {path}", soft_wrap=True)
    raise typer.Exit(interrupted.exit_code)


@app.command()
def report(run: Annotated[Path, typer.Argument(help="the folder of a run, evaluated before")]) -> None:
    """Write report.html into a run's folder."""
    Console().print(f"report: {write_report(run)}", soft_wrap=True)


@app.command()
def redo(dump: Annotated[Path, typer.Argument(help="a file in the dumps/ of a run that stopped")]) -> None:
    """Go once more through what made a run stop with a number that is not finite. For dumps of your own only."""
    Console().print(redo_dump(dump), soft_wrap=True)


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
    if own_rank() > 0:  # what the first worker says is true of the others as well, but for how they fail
        logging.getLogger().setLevel(logging.ERROR)
    try:
        app()
    except USAGE_ERRORS as error:
        _fail(error, 2)
    except FAILURES as error:
        _fail(error, 1)
    except KeyboardInterrupt:
        _fail(KeyboardInterrupt("interrupted"), 130)


def _fail(error: BaseException, status: int) -> None:
    speaker = f"thinknav (worker {own_rank()})" if started_by_torchrun() else "thinknav"
    sys.stderr.write(f"{speaker}: {error}\n")
    sys.exit(status)
