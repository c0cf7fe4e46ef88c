"""`thinknav demo`: all of it, once, small."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_trainer.config import load_config, presets
from thinknav_trainer.demo import run_demo
from thinknav_trainer.interrupt import interruption


def demo(
    runs: Annotated[Path, typer.Option(help="folder of all runs")] = Path("runs"),
    preset: Annotated[str, typer.Option(help=f"one of: {', '.join(presets())}")] = "demo",
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="e.g. --set ppo.lr=1e-4")
    ] = None,
) -> None:
    """Start a planning service, train, evaluate before and after, and write runs/demo/report.html."""
    config = load_config(preset, None, overrides or ())
    with interruption() as interrupted:
        page = run_demo(runs / "demo", config, interrupted)
    if page is not None:
        Console().print(f"report: {page}", soft_wrap=True)
    raise typer.Exit(interrupted.exit_code)
