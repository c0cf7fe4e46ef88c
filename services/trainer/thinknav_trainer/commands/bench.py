"""`thinknav bench`: how fast ThinkNav is on this machine. JSON lines go to stdout, a table for people to stderr."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_trainer.bench.figures import Figure, table
from thinknav_trainer.bench.simulator import simulator_figures
from thinknav_trainer.bench.soak import ALLOWED_GROWTH, growth, soak

Peers = Annotated[Path, typer.Option(help="virtual environment of the peers: make bench-peers")]
_PEERS = Path(".venv-peers")

app = typer.Typer(help="Measure speed and memory on this machine.", no_args_is_help=True)


@app.command("sim")
def measure_simulator(
    peers: Peers = _PEERS,
    repeats: Annotated[int, typer.Option(min=1, help="of each measurement; the median counts")] = 7,
) -> None:
    """The simulator's frames per second beside its peers', and what a step costs besides drawing. A few minutes."""
    _tell(simulator_figures(peers, repeats))


@app.command("train")
def measure_training(
    peers: Peers = _PEERS,
    repeats: Annotated[int, typer.Option(min=1, help="of each measurement; the median counts")] = 3,
    planner: Annotated[str | None, typer.Option(help="URL of a planning service; default: one of its own")] = None,
) -> None:
    """Steps per second of training beside its peers', where the time goes, and what a slow planner leaves of it.

    Some minutes.
    """
    from thinknav_trainer.bench.training import training_figures

    _tell(training_figures(repeats, peers, planner))


@app.command("soak")
def soak_simulator(
    minutes: Annotated[float, typer.Option(min=0.1, help="how long")] = 20.0,
) -> None:
    """Step for a long time while homes are swapped; exit status 1 when resident memory grows."""
    samples = []
    console = Console(stderr=True)
    for sample in soak(60 * minutes):
        samples.append(sample)
        console.print(f"{sample.seconds:6.0f} s  {sample.homes:5d} homes  {sample.megabytes:7.1f} MB", highlight=False)
    try:
        share = growth(samples)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--minutes") from None
    flat = share <= ALLOWED_GROWTH
    console.print(f"resident memory {'is flat' if flat else 'GROWS'}: {share:+.1%} from middle to end")
    raise typer.Exit(0 if flat else 1)


def _tell(measured: Iterable[Figure]) -> None:
    """A line of JSON for each figure as soon as it is measured, and a table for people at the end."""
    figures = []
    for figure in measured:
        sys.stdout.write(figure.line + "\n")
        sys.stdout.flush()
        figures.append(figure)
    Console(stderr=True).print(table(figures))
