"""`thinknav train`: a run, begun, gone on with or repeated."""

from pathlib import Path
from typing import Annotated

import typer

from thinknav_trainer.commands.options import Overrides, Preset, Runs, refuse_given
from thinknav_trainer.config import ConfigError, TrainConfig, change_config, load_config
from thinknav_trainer.interrupt import interruption
from thinknav_trainer.rewards import REWARD_SCHEMES
from thinknav_trainer.run import read_config
from thinknav_trainer.strategies import STRATEGIES
from thinknav_trainer.torchrun_environment import times_restarted
from thinknav_trainer.workers import join_workers
from thinknav_trainer.workflow import train_run


def train(
    context: typer.Context,
    name: Annotated[str, typer.Option(help="of the run: its folder in --runs")],
    preset: Preset = "cpu",
    config_file: Annotated[Path | None, typer.Option("--config", help="a YAML file over the preset")] = None,
    overrides: Overrides = None,
    strategy: Annotated[str | None, typer.Option(help=f"when to think, never or: {', '.join(STRATEGIES)}")] = None,
    reward: Annotated[str | None, typer.Option(help=f"the reward scheme: {', '.join(REWARD_SCHEMES)}")] = None,
    planner: Annotated[str | None, typer.Option(help="URL of the planning service, over the configuration's")] = None,
    runs: Runs = Path("runs"),
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run of this name")] = False,
    replay: Annotated[Path | None, typer.Option(help="a run's folder: its recorded replies, no service")] = None,
) -> None:
    """Train a policy. Needs a planning service (thinknav-server serve), but for think.strategy=never.

    With --resume the run's own configuration takes the place of the preset; with --replay that of the recorded run.
    --strategy and --reward stand for --set think.strategy=… and think.reward=….
    Under torchrun several processes train one policy (docs/scaling.md), and go on by themselves where it restarts them.
    """
    if resume or replay:
        refuse_given(context, ("preset",), "the run that is gone on with or repeated has its own configuration")
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
        typer.echo(f"checkpoint: {path}")
    raise typer.Exit(interrupted.exit_code)
