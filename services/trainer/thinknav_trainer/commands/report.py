"""`thinknav report`: a run on a page."""

from pathlib import Path
from typing import Annotated

import typer

from thinknav_trainer.report import write_report


def report(run: Annotated[Path, typer.Argument(help="the folder of a run, evaluated before")]) -> None:
    """Write report.html into a run's folder."""
    typer.echo(f"report: {write_report(run)}")
