"""`thinknav experiment` and `thinknav reproduce`: arms and seeds, a ledger, a table and figures."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_trainer.commands.options import Runs, check_folder, refuse_given
from thinknav_trainer.config import ConfigError
from thinknav_trainer.experiments import (
    EXPERIMENTS,
    REPRODUCED,
    Done,
    Experiment,
    Wanted,
    named_experiment,
    run_experiment,
    write_results,
)
from thinknav_trainer.interrupt import interruption

Seeds = Annotated[int | None, typer.Option(min=1, help="of each arm; default: as many as it has")]
Arms = Annotated[str | None, typer.Option(help="train some of the arms alone, separated by commas; default: all")]
Jobs = Annotated[int, typer.Option(min=1, help="runs at a time; more than one: each with one thread")]
Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="one key, in every arm")]
Results = Annotated[
    Path | None, typer.Option(help="of ledger, table and figures; default: docs/results where it is there, or results")
]
Smoke = Annotated[bool, typer.Option("--smoke", help="everything runs in seconds, nothing is learnt")]
Quick = Annotated[bool, typer.Option("--quick", help="the story in about ten minutes, where there is such a form")]
Table = Annotated[bool, typer.Option("--table", help="only write down what there is")]


def experiment(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help=", ".join(EXPERIMENTS))],
    seeds: Seeds = None,
    arms: Arms = None,
    jobs: Jobs = 1,
    overrides: Overrides = None,
    runs: Runs = Path("runs"),
    results: Results = None,
    smoke: Smoke = False,
    quick: Quick = False,
    table: Table = False,
) -> None:
    """Train and evaluate the arms of an experiment; the same command goes on with what was begun."""
    _check(context, table, results)
    for override in overrides or ():
        if override.partition("=")[0].strip() == "seed":
            raise ConfigError("--set seed: an experiment numbers its seeds itself; see --seeds")
    wanted = Wanted(_names(arms), seeds, jobs, tuple(overrides or ()))
    _conduct(_form(named_experiment(name), smoke, quick), wanted, runs, results, table)


def reproduce(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help=", ".join(REPRODUCED))],
    seeds: Seeds = None,
    arms: Arms = None,
    jobs: Jobs = 1,
    runs: Runs = Path("runs"),
    results: Results = None,
    smoke: Smoke = False,
    quick: Quick = False,
    table: Table = False,
) -> None:
    """Reproduce the paper: in one home, in five, in homes never seen. The same command goes on with what was begun."""
    if name not in REPRODUCED:
        raise ConfigError(
            f"there is {', '.join(REPRODUCED)} to reproduce, not {name!r}; for a dump: thinknav redo DUMP"
        )
    _check(context, table, results)
    _conduct(_form(named_experiment(name), smoke, quick), Wanted(_names(arms), seeds, jobs), runs, results, table)


def _check(context: typer.Context, table: bool, results: Path | None) -> None:
    """Refuse what does not go together, before anything is trained. Raises ConfigError."""
    if table:
        refuse_given(context, ("arms", "seeds", "jobs"), "--table is of all that there is, and trains nothing")
    check_folder("--results", results)


def _form(wanted: Experiment, smoke: bool, quick: bool) -> Experiment:
    if smoke and quick:
        raise ConfigError("give either --smoke or --quick")
    if smoke:
        return wanted.smoked()
    return wanted.quickened() if quick else wanted


def _names(arms: str | None) -> tuple[str, ...]:
    return () if arms is None else tuple(name.strip() for name in arms.split(","))


def _conduct(chosen: Experiment, wanted: Wanted, runs: Path, results: Path | None, table: bool) -> None:
    """Run it, or only write down what there is; and tell."""
    folder = runs / chosen.full_name
    place = results or _usual_results(chosen, folder, wanted)
    with interruption() as interrupted:
        if table:
            done = Done(write_results(chosen, place, wanted))
            if done.page is None:
                raise ConfigError(f"nothing of {chosen.full_name} is done yet in {place}; see --results")
        else:
            done = run_experiment(chosen, folder, place, interrupted, wanted)
    console = Console(soft_wrap=True, markup=False, highlight=False)
    if done.page is not None:
        console.print(done.page.read_text())
        console.print(f"table: {done.page}")
    for failure in done.failures:
        console.print(f"FAILED: {failure.job.arm}, seed {failure.job.seed}: {failure.words} ({failure.log})")
    raise typer.Exit(interrupted.exit_code or bool(done.failures))


def _usual_results(chosen: Experiment, folder: Path, wanted: Wanted) -> Path:
    """What was changed by hand, and smoke, do not go where results are kept."""
    if chosen.form == "smoke" or wanted.overrides:
        return folder / "results"
    kept = Path("docs") / "results"
    return kept if kept.is_dir() else Path("results")
