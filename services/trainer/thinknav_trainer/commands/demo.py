"""`thinknav demo`: all of it, once, small."""

from pathlib import Path

import typer

from thinknav_trainer.commands.options import Overrides, Preset, Runs
from thinknav_trainer.config import load_config
from thinknav_trainer.demo import run_demo
from thinknav_trainer.interrupt import interruption


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
        typer.echo(f"report: {page}")
    raise typer.Exit(interrupted.exit_code)
