"""Options that several commands have."""

from collections.abc import Collection
from pathlib import Path
from typing import Annotated

import typer

from thinknav_trainer.config import ConfigError, presets

Preset = Annotated[str, typer.Option(help=f"one of: {', '.join(presets())}")]
Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="e.g. --set ppo.lr=1e-4")]
Runs = Annotated[Path, typer.Option(help="folder of all runs")]


def check_folder(option: str, path: Path | None) -> None:
    """Refuse a file where a folder is written to, if one is named. Raises ConfigError."""
    if path is not None and path.exists() and not path.is_dir():
        raise ConfigError(f"{option} {path} is not a folder")


def refuse_given(context: typer.Context, options: Collection[str], because: str) -> None:
    """Refuse options (names of parameters) that would change nothing here. Raises ConfigError that names them."""
    given = [
        parameter.opts[0]
        for parameter in context.command.params
        if parameter.name in options and _is_given(context, parameter.name)
    ]
    if given:
        raise ConfigError(f"{', '.join(given)}: {because}")


def _is_given(context: typer.Context, parameter: str) -> bool:
    # By its name, for typer keeps the class to itself.
    source = context.get_parameter_source(parameter)
    return source is not None and source.name == "COMMANDLINE"
