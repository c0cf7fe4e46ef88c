"""`thinknav bench`: how fast ThinkNav is on this machine. JSON lines go to stdout, a table for people to stderr."""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_trainer.bench.figures import Figure, rounded, table
from thinknav_trainer.bench.memory import ALLOWED_GROWTH, growth
from thinknav_trainer.bench.simulator import simulator_figures
from thinknav_trainer.bench.soak import soak
from thinknav_trainer.config import load_config, presets
from thinknav_trainer.interrupt import interruption

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
    part: Annotated[list[str] | None, typer.Option(help="speed, peers, latency or scaling; default: all")] = None,
) -> None:
    """Steps per second of training beside its peers', where the time goes, and what a slow planner leaves of it.

    Some minutes.
    """
    from thinknav_trainer.bench.training import PARTS, training_figures

    if unknown := set(part or ()) - set(PARTS):
        raise typer.BadParameter(f"{', '.join(sorted(unknown))}: not one of {', '.join(PARTS)}", param_hint="--part")
    _tell(training_figures(repeats, peers, planner, part or PARTS))


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
    share = _growth([sample.megabytes for sample in samples], "--minutes")
    raise typer.Exit(0 if _is_flat(share, console) else 1)


@app.command("train-gpu")
def measure_training_on_a_gpu(
    repeats: Annotated[int, typer.Option(min=1, help="of each measurement; the median counts")] = 3,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="over the presets")] = None,
) -> None:
    """Steps per second of the presets gpu, with 64 to 2,048 envs, and paper, on a CUDA GPU."""
    from thinknav_trainer.bench.training_gpu import gpu_figures

    _tell(gpu_figures(repeats, overrides=overrides or ()))


@app.command("train-memory")
def watch_training_memory(
    steps: Annotated[int, typer.Option(min=1, help="environment steps to train for")] = 2_000_000,
    samples: Annotated[int, typer.Option(min=1, help="how often memory is looked at meanwhile")] = 100,
    preset: Annotated[str, typer.Option(help=f"one of: {', '.join(presets())}")] = "cpu",
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="of the run")] = None,
) -> None:
    """Train for a long time and forget the run; exit status 1 when the trainer's memory grows.

    The planner is the embedded one in a process of its own, unless planner.url says otherwise. Hours.
    """
    from thinknav_trainer.bench.training_memory import TrainingSample, watch_training

    config = load_config(preset, None, [*(overrides or []), f"total_steps={steps}"])
    taken: list[TrainingSample] = []

    def tell(sample: TrainingSample) -> None:
        taken.append(sample)
        sys.stdout.write(sample.line + "\n")
        sys.stdout.flush()

    with interruption() as interrupted:
        watch_training(config, max(1, steps // samples), tell, interrupted)
    share = _growth([sample.megabytes for sample in taken], "--steps")
    _tell([Figure("train.memory_growth", rounded(share), "share of the memory, from middle to end")])
    raise typer.Exit(interrupted.exit_code or int(not _is_flat(share, Console(stderr=True))))


def _growth(megabytes: Sequence[float], asked_by: str) -> float:
    try:
        return growth(megabytes)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=asked_by) from None


def _is_flat(share: float, console: Console) -> bool:
    flat = share <= ALLOWED_GROWTH
    console.print(f"resident memory {'is flat' if flat else 'GROWS'}: {share:+.1%} from middle to end")
    return flat


def _tell(measured: Iterable[Figure]) -> None:
    """A line of JSON for each figure as soon as it is measured, and a table for people at the end."""
    figures = []
    for figure in measured:
        sys.stdout.write(figure.line + "\n")
        sys.stdout.flush()
        figures.append(figure)
    Console(stderr=True).print(table(figures))
