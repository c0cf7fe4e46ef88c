"""`thinknav report`: a run on a page."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from thinknav_trainer.report import write_report


def report(run: Annotated[Path, typer.Argument(help="the folder of a run, evaluated before")]) -> None:
    """Write report.html into a run's folder."""
    Console().print(f"report: {write_report(run)}", soft_wrap=True)
