"""`thinknav redo`: why a run stopped."""

from pathlib import Path
from typing import Annotated

import typer

from thinknav_trainer.redo import redo_dump


def redo(dump: Annotated[Path, typer.Argument(help="a file in the dumps/ of a run that stopped")]) -> None:
    """Go once more through what made a run stop with a number that is not finite. For dumps of your own only."""
    typer.echo(redo_dump(dump))
