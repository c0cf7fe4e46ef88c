"""Options of the command line from a YAML file, for those that neither the command line nor the environment gives.

    thinknav-server serve --config server.yaml

A key is the name of an option with underscores or dashes (`max_batch: 16`). One file may serve several commands: what
another command of `thinknav-server` understands is passed over.
"""

import difflib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml


def _read(context: typer.Context, path: Path | None) -> Path | None:
    """The file's values as click's defaults: below the command line and the environment, above the built-in ones."""
    if path is None or context.resilient_parsing:
        return path
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise typer.BadParameter(f"cannot read {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise typer.BadParameter(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(values or {}, dict):
        raise typer.BadParameter(f"{path} must hold a mapping such as 'port: 8765', not a {type(values).__name__}")
    settings = {str(key).replace("-", "_"): value for key, value in (values or {}).items()}
    known = _options(context)
    for name, value in settings.items():
        if not isinstance(value, str | int | float) and not (known.get(name) and isinstance(value, list)):
            raise typer.BadParameter(f"{path}: {name} takes one value, not {value!r}")
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            raise typer.BadParameter(f"{path}: there is no option {name!r}{hint}")
    several = {parameter.name for parameter in context.command.params if getattr(parameter, "multiple", False)}
    for name in several & settings.keys():
        if not isinstance(settings[name], list):
            settings[name] = [settings[name]]
    context.default_map = {**settings, **(context.default_map or {})}
    return path


def _options(context: typer.Context) -> dict[str, bool]:
    """The names of the options of all commands, and whether each may be given several times."""
    return {
        parameter.name: getattr(parameter, "multiple", False)
        for parameter in _parameters(context.find_root().command)
        if parameter.name and parameter.name != "_config"
    }


def _parameters(command: Any) -> Iterator[Any]:
    """Of a command, and of all below it."""
    yield from command.params
    for below in getattr(command, "commands", {}).values():
        yield from _parameters(below)


SettingsFile = Annotated[
    Path | None,
    typer.Option(
        "--config",
        envvar="THINKNAV_SERVER_CONFIG",
        is_eager=True,
        callback=_read,
        help="YAML file of options: max_batch: 16",
    ),
]
