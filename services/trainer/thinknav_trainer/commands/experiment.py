"""`thinknav experiment`: arms and seeds in turn, and a table."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_trainer.experiments import EXPERIMENTS, named_experiment, run_experiment
from thinknav_trainer.interrupt import interruption


def experiment(
    name: Annotated[str, typer.Argument(help=", ".join(EXPERIMENTS))],
    seeds: Annotated[int | None, typer.Option(min=1, help="how many; default: the experiment's")] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="one key, in every arm")
    ] = None,
    runs: Annotated[Path, typer.Option(help="folder of all runs")] = Path("runs"),
    smoke: Annotated[bool, typer.Option("--smoke", help="everything runs in seconds, nothing is learnt")] = False,
) -> None:
    """Train and evaluate the arms of an experiment; the same command goes on with what was begun."""
    wanted = named_experiment(name)
    folder = runs / (f"{name}-smoke" if smoke else name)
    with interruption() as interrupted:
        page = run_experiment(wanted, folder, seeds or wanted.seeds, interrupted, overrides or (), smoke)
    if page is not None:
        Console().print(page.read_text(), soft_wrap=True, markup=False, highlight=False)
        Console().print(f"table: {page}", soft_wrap=True)
    raise typer.Exit(interrupted.exit_code)
