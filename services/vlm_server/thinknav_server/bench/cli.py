"""`thinknav-server bench`: JSON lines on standard output."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from thinknav_server.bench.figures import Figure
from thinknav_server.bench.overload import overload_figures
from thinknav_server.bench.soak import soak
from thinknav_server.bench.throughput import throughput_figures
from thinknav_server.settings_file import SettingsFile

app = typer.Typer(help="Measure the service on this machine, as lines of JSON.", no_args_is_help=True)


@app.command()
def throughput(
    _config: SettingsFile = None,
    peers: Annotated[Path, typer.Option(help="Virtual environment with LitServe: make bench-server-peers.")] = Path(
        ".venv-serving"
    ),
    seconds: Annotated[float, typer.Option(min=0.1, help="Of each measurement, in five turns.")] = 10.0,
) -> None:
    """Subgoals a second beside LitServe's and the model's own, and what a lone request costs above the model."""
    _print(throughput_figures(peers, seconds))


@app.command()
def overload(
    _config: SettingsFile = None,
    seconds: Annotated[float, typer.Option(min=1, help="Of overload.")] = 60.0,
) -> None:
    """Ten times the load that the service can bear: who is admitted, who is refused, how soon it is over."""
    _print(overload_figures(seconds))


@app.command("soak")
def soak_service(
    _config: SettingsFile = None,
    minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 30.0,
) -> None:
    """Good and bad requests together for a long time; exit status 1 when any is answered wrongly, or memory grows."""
    soaked = soak(60 * minutes)
    _print(soaked.figures())
    complaints = soaked.complaints()
    for complaint in complaints:
        typer.echo(f"thinknav-server: {complaint}", err=True)
    raise typer.Exit(bool(complaints))


def _print(figures: Iterable[Figure]) -> None:
    try:
        for figure in figures:
            sys.stdout.write(figure.line + "\n")
            sys.stdout.flush()
    except (ValueError, RuntimeError) as error:
        typer.echo(f"thinknav-server: {error}", err=True)
        raise typer.Exit(1) from None
