"""`thinknav compare`: evaluations side by side."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from thinknav_trainer.compare import Column, compare, read_evaluations
from thinknav_trainer.config import ConfigError
from thinknav_trainer.records import MEASURES


def compare_runs(
    runs: Annotated[list[Path], typer.Argument(help="folders of evaluations, or of runs: their last one")],
    output: Annotated[Path | None, typer.Option(help="a JSON file of all numbers")] = None,
) -> None:
    """Compare evaluations of the same episodes: means, and differences from the first with paired 95 % intervals."""
    if len(runs) < 2:
        raise ConfigError("give two or more evaluations to compare")
    evaluations = read_evaluations(runs)
    columns = compare(evaluations)
    Console(markup=False).print(_table(columns, len(evaluations[0].records)))
    if output is not None:
        output.write_text(json.dumps([asdict(column) for column in columns], indent=2) + "\n")


def _table(columns: list[Column], episodes: int) -> Table:
    title = f"{episodes} episodes; below each mean, what it is above the first one's, and the paired 95 % interval"
    table = Table("measure", *(column.name for column in columns), title=title, title_justify="left")
    for measure in MEASURES:
        table.add_row(measure, *(_cell(column, measure) for column in columns))
    return table


def _cell(column: Column, measure: str) -> str:
    mean = f"{column.summary[measure]['mean']:.3f}"
    if not column.difference:
        return mean
    row = column.difference[measure]
    return f"{mean}\n{row['mean']:+.3f} ({row['low']:+.3f} to {row['high']:+.3f})"
