"""`thinknav-server bench`: JSON lines on standard output."""

import sys
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from thinknav_server.bench.figures import Figure
from thinknav_server.bench.overload import overload_figures
from thinknav_server.bench.soak import soak
from thinknav_server.bench.throughput import throughput_figures
from thinknav_server.cli_sections import refused
from thinknav_server.planner_options import Decode
from thinknav_server.settings_file import SettingsFile


class VlmSize(StrEnum):
    """The models that `bench vlm` draws."""

    TWO_BILLION = "2b"
    TINY = "tiny"


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


@app.command()
def vlm(
    _config: SettingsFile = None,
    size: Annotated[VlmSize, typer.Option(help="Of the model.")] = VlmSize.TWO_BILLION,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:1.")] = "auto",
    decode: Annotated[list[Decode], typer.Option(help="As of `serve`; may be repeated.")] = [Decode.DYNAMIC],  # noqa: B006
    clients: Annotated[list[int], typer.Option(min=1, help="Who ask at once; may be repeated.")] = [1, 16, 64, 256],  # noqa: B006
    max_batch: Annotated[int, typer.Option(min=1, help="Requests that the model sees at once.")] = 64,
    seconds: Annotated[float, typer.Option(min=0.1, help="For each number of clients.")] = 20.0,
) -> None:
    """Qwen3-VL of full size with random weights, 256 x 256 frames, 12 words: alone, and behind the service."""
    try:
        from thinknav_server.bench.vlm import VlmSetup, vlm_figures
    except ImportError as error:
        raise refused(
            f"this needs libraries that are not installed ({error}); pip install 'thinknav[server,vlm]'"
        ) from None
    _print(vlm_figures(VlmSetup(size.value, device, [d.value for d in decode], clients, max_batch, seconds)))


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
