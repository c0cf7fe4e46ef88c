"""Options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from thinknav_trainer.config import presets

Preset = Annotated[str, typer.Option(help=f"one of: {', '.join(presets())}")]
Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="e.g. --set ppo.lr=1e-4")]
Runs = Annotated[Path, typer.Option(help="folder of all runs")]
