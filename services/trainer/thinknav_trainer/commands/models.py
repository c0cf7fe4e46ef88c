"""`thinknav models`: make the small networks that ThinkNav ships, and measure them."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_models.clip.text import CLIP_WEIGHTS
from thinknav_trainer.config import ConfigError
from thinknav_trainer.interrupt import interruption

CLIP_BATCHES = 1_800

app = typer.Typer(help="The small networks that ThinkNav ships: make them anew, measure them.", no_args_is_help=True)
train_app = typer.Typer(help="Train from nothing, or go on where a training in the same folder was stopped.")
evaluate_app = typer.Typer(help="Measure on validation homes, never seen in training.", no_args_is_help=True)
app.add_typer(train_app, name="train", invoke_without_command=True)
app.add_typer(evaluate_app, name="evaluate")

Output = Annotated[Path, typer.Option(help="folder of weights and card")]
Scans = Annotated[list[Path] | None, typer.Option("--scans", help="scans to use in place of homes; may be repeated")]
Seed = Annotated[int, typer.Option(min=0, help="of weights, poses and sentences")]


@train_app.callback()
def train_all(context: typer.Context) -> None:
    """Train every network, one after the other."""
    if context.invoked_subcommand is None:
        train_clip()


@train_app.command("clip")
def train_clip(
    output: Output = Path("runs/models"),
    checkpoints: Annotated[Path, typer.Option(help="folder to go on from")] = Path("runs/models/clip-training"),
    batches: Annotated[int, typer.Option(min=1, help="of the whole training")] = CLIP_BATCHES,
    scans: Scans = None,
    seed: Seed = 0,
) -> None:
    """Train the small CLIP: write OUTPUT/clip.safetensors and its card, OUTPUT/clip.md.

    It saves as it goes, and the same command goes on where it was stopped.
    """
    from thinknav_trainer.model_training.clip_train import ClipTraining
    from thinknav_trainer.model_training.clip_workflow import train_and_describe

    if output.exists() and not output.is_dir():
        raise ConfigError(f"--output {output} is not a folder")
    options = [f"--batches {batches}", *(f"--scans {path}" for path in scans or ()), f"--seed {seed}"]
    command = " ".join(["thinknav models train clip", *options])
    with interruption() as interrupted:
        path = train_and_describe(
            output, checkpoints, ClipTraining(batches), scans or (), command, interrupted, seed=seed
        )
    if path is None:
        raise typer.Exit(interrupted.exit_code)
    Console().print(f"weights: {path}", soft_wrap=True, markup=False)


@evaluate_app.command("clip")
def evaluate_clip(
    weights: Annotated[Path, typer.Option(help="of a CLIP, by default the one that ThinkNav ships")] = CLIP_WEIGHTS,
    scans: Scans = None,
    homes: Annotated[int, typer.Option(min=1, help="validation homes to take frames of")] = 50,
    examples: Annotated[Path | None, typer.Option(help="folder to write ten frames and their sentences to")] = None,
) -> None:
    """Print how well the small CLIP retrieves, with its controls, and how far directions lie apart."""
    from thinknav_trainer.model_training.clip_card import table
    from thinknav_trainer.model_training.clip_examples import write_examples
    from thinknav_trainer.model_training.clip_workflow import evaluate_weights

    if examples is not None and examples.exists() and not examples.is_dir():
        raise ConfigError(f"--examples {examples} is not a folder")
    measures, gap = evaluate_weights(weights, scans or (), homes)
    console = Console()
    console.print(table(measures), soft_wrap=True, markup=False)
    console.print(
        f"\nsubgoals: cosine {gap.same:.3f} within a direction, {gap.other:.3f} between, {gap.closest:.3f} at most; "
        f"{gap.sorted_right:.1%} nearest to their own",
        soft_wrap=True,
        markup=False,
    )
    if examples is not None:
        console.print(
            f"examples: {write_examples(examples, weights, scans or (), homes)}", soft_wrap=True, markup=False
        )
