"""`thinknav models`: make the small networks that ThinkNav ships, and measure them."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_models.clip.text import CLIP_WEIGHTS
from thinknav_models.weights import SHIPPED
from thinknav_trainer.commands.options import check_folder, refuse_given
from thinknav_trainer.interrupt import Interruption, interruption

CLIP_BATCHES = 1_800
CLIP_SMALL_BATCHES = 1_000
SUBGOAL_VISITS = 6_000
MOST_HOMES = 100_000
DEFAULT_OUTPUT = Path("runs/models")
SUBGOAL_WEIGHTS = SHIPPED / "subgoal_vlm.safetensors"  # as in the model's own file, which loads torch

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
        with interruption() as interrupted:
            _make_clip(DEFAULT_OUTPUT, DEFAULT_OUTPUT / "clip-training", CLIP_BATCHES, [], 0, interrupted)
            if not interrupted.requested:
                _make_clip_small(
                    DEFAULT_OUTPUT, DEFAULT_OUTPUT / "clip-small-training", CLIP_SMALL_BATCHES, 0, interrupted
                )
            if not interrupted.requested:
                _make_subgoal(DEFAULT_OUTPUT, SUBGOAL_VISITS, MOST_HOMES, [], 0, interrupted)
        raise typer.Exit(interrupted.exit_code)


@train_app.command("clip")
def train_clip(
    output: Output = DEFAULT_OUTPUT,
    checkpoints: Annotated[Path, typer.Option(help="folder to go on from")] = DEFAULT_OUTPUT / "clip-training",
    batches: Annotated[int, typer.Option(min=1, help="of the whole training")] = CLIP_BATCHES,
    scans: Scans = None,
    seed: Seed = 0,
) -> None:
    """Train the small CLIP: write OUTPUT/clip.safetensors and its card, OUTPUT/clip.md.

    It saves as it goes, and the same command goes on where it was stopped.
    """
    with interruption() as interrupted:
        _make_clip(output, checkpoints, batches, scans or [], seed, interrupted)
    raise typer.Exit(interrupted.exit_code)


@train_app.command("clip-small")
def train_clip_small(
    output: Output = DEFAULT_OUTPUT,
    checkpoints: Annotated[Path, typer.Option(help="folder to go on from")] = DEFAULT_OUTPUT / "clip-small-training",
    batches: Annotated[int, typer.Option(min=1, help="of the whole training")] = CLIP_SMALL_BATCHES,
    seed: Seed = 0,
) -> None:
    """Teach the small image encoder what the shipped CLIP sees: write OUTPUT/clip_small.safetensors and its card.

    It saves as it goes, and the same command goes on where it was stopped.
    """
    with interruption() as interrupted:
        _make_clip_small(output, checkpoints, batches, seed, interrupted)
    raise typer.Exit(interrupted.exit_code)


@train_app.command("subgoal")
def train_subgoal(
    context: typer.Context,
    output: Output = DEFAULT_OUTPUT,
    visits: Annotated[int, typer.Option(min=2, help="to homes, in the whole training")] = SUBGOAL_VISITS,
    homes: Annotated[int, typer.Option(min=1, help="that are visited in turn")] = MOST_HOMES,
    scans: Scans = None,
    seed: Seed = 0,
) -> None:
    """Train the subgoal VLM: write OUTPUT/subgoal_vlm.safetensors and its card, OUTPUT/subgoal_vlm.md.

    Ctrl-C stops it with a checkpoint; the same command goes on from there.
    """
    _refuse_homes_beside(scans, context)
    with interruption() as interrupted:
        _make_subgoal(output, visits, homes, scans or [], seed, interrupted)
    raise typer.Exit(interrupted.exit_code)


def _make_clip(
    output: Path, checkpoints: Path, batches: int, scans: list[Path], seed: int, interrupted: Interruption
) -> None:
    from thinknav_trainer.model_training.clip_train import ClipTraining
    from thinknav_trainer.model_training.clip_workflow import train_and_describe

    check_folder("--output", output)
    command = _command("clip", f"--batches {batches}", scans, seed)
    _tell(train_and_describe(output, checkpoints, ClipTraining(batches), scans, command, interrupted, seed=seed))


def _make_clip_small(output: Path, checkpoints: Path, batches: int, seed: int, interrupted: Interruption) -> None:
    from thinknav_trainer.model_training.clip_small import SmallTraining
    from thinknav_trainer.model_training.clip_small_workflow import train_and_describe

    check_folder("--output", output)
    command = _command("clip-small", f"--batches {batches}", [], seed)
    _tell(train_and_describe(output, checkpoints, SmallTraining(batches), command, interrupted, seed=seed))


def _make_subgoal(
    output: Path, visits: int, homes: int, scans: list[Path], seed: int, interrupted: Interruption
) -> None:
    from thinknav_trainer.model_training.subgoal_training import Schooling
    from thinknav_trainer.model_training.subgoal_workflow import train_and_describe

    check_folder("--output", output)
    command = _command("subgoal", f"--visits {visits} --homes {homes}", scans, seed)
    schooling = Schooling(visits=visits, homes=len(scans) or homes, seed=seed)
    _tell(train_and_describe(output, schooling, scans, command, interrupted))


def _command(network: str, length: str, scans: list[Path], seed: int) -> str:
    """What to type to get the same again."""
    options = [length, *(f"--scans {path}" for path in scans), f"--seed {seed}"]
    return f"thinknav models train {network} {' '.join(options)}"


def _refuse_homes_beside(scans: list[Path] | None, context: typer.Context) -> None:
    if scans:
        refuse_given(context, ("homes",), "scans are used in place of homes")


def _tell(weights: Path | None) -> None:
    if weights is not None:
        Console().print(f"weights: {weights}", soft_wrap=True, markup=False)


@evaluate_app.command("clip")
def evaluate_clip(
    context: typer.Context,
    weights: Annotated[Path, typer.Option(help="of a CLIP, by default the one that ThinkNav ships")] = CLIP_WEIGHTS,
    scans: Scans = None,
    homes: Annotated[int, typer.Option(min=1, help="validation homes to take frames of")] = 50,
    examples: Annotated[Path | None, typer.Option(help="folder to write ten frames and their sentences to")] = None,
) -> None:
    """Print how well the small CLIP retrieves, with its controls, and how far directions lie apart."""
    from thinknav_trainer.model_training.clip_card import table
    from thinknav_trainer.model_training.clip_examples import write_examples
    from thinknav_trainer.model_training.clip_workflow import evaluate_weights

    _refuse_homes_beside(scans, context)
    check_folder("--examples", examples)
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
        written = write_examples(examples, weights, scans or (), homes)
        console.print(f"examples: {written}", soft_wrap=True, markup=False)


@evaluate_app.command("clip-small")
def evaluate_clip_small(
    weights: Annotated[Path | None, typer.Option(help="of a small image encoder; default: the shipped ones")] = None,
    homes: Annotated[int, typer.Option(min=1, help="validation homes to take frames of")] = 50,
) -> None:
    """Print how well the small image encoder retrieves in frames of 64 by 64, with its controls."""
    from thinknav_models.clip.image import SMALL_WEIGHTS
    from thinknav_trainer.model_training.clip_card import table
    from thinknav_trainer.model_training.clip_small_workflow import evaluate_small

    Console().print(table(evaluate_small(weights or SMALL_WEIGHTS, homes)), soft_wrap=True, markup=False)


@evaluate_app.command("subgoal")
def evaluate_subgoal(
    context: typer.Context,
    weights: Annotated[Path, typer.Option(help="of a subgoal VLM; default: the shipped ones")] = SUBGOAL_WEIGHTS,
    scans: Scans = None,
    homes: Annotated[int, typer.Option(min=4, help="validation homes to ask in")] = 60,
) -> None:
    """Print how often the subgoal VLM knows the way, with its controls."""
    from thinknav_models.subgoal_vlm import load_network
    from thinknav_trainer.model_training.subgoal_card import accuracy_table, calibration_table, stop_table
    from thinknav_trainer.model_training.subgoal_workflow import examine

    _refuse_homes_beside(scans, context)
    exam = examine(weights, homes, scans or ())
    parts = [
        "anywhere:",
        accuracy_table(exam.anywhere),
        "under way:",
        accuracy_table(exam.under_way),
        "stop:",
        stop_table(exam, load_network(weights).stop_gate),
        "confidence, under way, several frames:",
        calibration_table(exam.under_way["several frames", "none"]),
    ]
    Console().print("\n\n".join(parts), soft_wrap=True, markup=False)
