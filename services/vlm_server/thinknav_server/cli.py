"""The command `thinknav-server`."""

import logging
import signal
from enum import StrEnum
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from pydantic import ValidationError

from thinknav_models import HashedWords
from thinknav_proto import Limits, describe
from thinknav_server.cli_doors import door_settings, limits
from thinknav_server.cli_sections import takes
from thinknav_server.doors import open_doors
from thinknav_server.planners import Planner, Script, ScriptedPlanner, load_script
from thinknav_server.server import run, stop_at_end_of_input
from thinknav_server.service import PlanningService
from thinknav_server.settings import DoorSettings, Settings
from thinknav_server.settings_file import SettingsFile

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"auto_envvar_prefix": "THINKNAV_SERVER"},
)


class PlannerName(StrEnum):
    """The planners that can be served."""

    SCRIPTED = "scripted"


class LogLevel(StrEnum):
    """How much the log tells."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@app.callback()
def about() -> None:
    """The planning service of ThinkNav: frames and goals in, subgoals and their embeddings out."""


@app.command()
@takes(doors=door_settings, limits=limits)
def serve(
    doors: DoorSettings,
    limits: Limits,
    _config: SettingsFile = None,
    planner: Annotated[PlannerName, typer.Option(help="Who plans.")] = PlannerName.SCRIPTED,
    script: Annotated[Path | None, typer.Option(help="scripted: YAML or JSON file with the sentences.")] = None,
    latency: Annotated[float, typer.Option(min=0, help="scripted: seconds that each batch takes.")] = 0.0,
    failure_rate: Annotated[float, typer.Option(min=0, max=1, help="scripted: share of requests that fail.")] = 0.0,
    seed: Annotated[int, typer.Option(help="scripted: of the failures.")] = 0,
    max_batch: Annotated[int, typer.Option(min=1, help="Requests that the planner sees at once.")] = 32,
    max_wait: Annotated[float, typer.Option(min=0, help="Seconds that a request waits for others.")] = 0.0,
    queue_size: Annotated[int, typer.Option(min=1, help="Requests that wait at most; more are refused.")] = 256,
    announce: Annotated[Path | None, typer.Option(help="File to write the URL to, once it is served.")] = None,
    until_eof: Annotated[bool, typer.Option("--until-eof", help="Stop when standard input ends.")] = False,
    log_level: Annotated[LogLevel, typer.Option(help="How much the log tells.")] = LogLevel.INFO,
) -> None:
    """Serve subgoals until stopped by Ctrl+C or SIGTERM.

    Each option may also be given in the environment, as THINKNAV_SERVER_SERVE_<OPTION>, or in the settings file.
    """
    for signal_number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(signal_number, _leave)
    if until_eof:
        stop_at_end_of_input()
    logging.basicConfig(level=log_level.upper(), format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    try:
        settings = Settings(max_batch=max_batch, max_wait=max_wait, queue_size=queue_size, limits=limits)
        service = PlanningService(_planner(planner, script, latency, failure_rate, seed), HashedWords(), settings)
        opened = open_doors(service, doors)
    except ValidationError as error:
        raise _refused(describe(error)) from None
    except (ValueError, OSError) as error:
        raise _refused(str(error)) from None
    run(opened.app, opened.listener, announce, f"planner {service.info.identity}", opened.tls)


def main() -> None:
    """The console script."""
    app()


def _planner(name: PlannerName, script: Path | None, latency: float, failure_rate: float, seed: int) -> Planner:
    """Raises ValueError for a script that cannot be used."""
    match name:
        case PlannerName.SCRIPTED:
            return ScriptedPlanner(load_script(script) if script else Script(), latency, failure_rate, seed)


def _refused(message: str) -> typer.Exit:
    typer.echo(f"thinknav-server: {message}", err=True)
    return typer.Exit(1)


def _leave(_signal: int, _frame: FrameType | None) -> None:
    """Being told to stop is no failure. Uvicorn stops gracefully, then raises the signal again: to here."""
    raise SystemExit(0)
