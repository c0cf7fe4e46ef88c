"""The command `thinknav-server`."""

import os
import signal
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer
from pydantic import ValidationError

from thinknav_proto import Limits, PlannerError, describe
from thinknav_proto.codec import MAX_ARRAY_LENGTH
from thinknav_server.bench.cli import app as bench_app
from thinknav_server.check import check_planner
from thinknav_server.cli_sections import refused, takes
from thinknav_server.door_options import accepted_limits, door_settings
from thinknav_server.doors import open_doors
from thinknav_server.hosts import Host, PlannerInLoop, PlannerProcess, PlannerThread
from thinknav_server.hosts.process import ProcessSettings
from thinknav_server.logs import configure_logs
from thinknav_server.planner_options import planner_options, process_settings
from thinknav_server.planners.options import PlannerOptions, load_text_encoder, load_thinker
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


app.add_typer(bench_app, name="bench")


@app.callback()
def about() -> None:
    """The planning service of ThinkNav: frames and goals in, subgoals and their embeddings out."""


@app.command()
@takes(planner=planner_options, process=process_settings, doors=door_settings, limits=accepted_limits)
def serve(
    planner: PlannerOptions,
    process: ProcessSettings,
    doors: DoorSettings,
    limits: Limits,
    _config: SettingsFile = None,
    max_batch: Annotated[
        int, typer.Option(min=1, max=MAX_ARRAY_LENGTH, help="Requests that the planner sees at once.")
    ] = 32,
    max_wait: Annotated[float, typer.Option(min=0, help="Seconds that a request waits for others at most.")] = 0.0,
    queue_size: Annotated[int, typer.Option(min=1, help="Requests that wait at most; more are refused.")] = 256,
    cache_size: Annotated[int, typer.Option(min=0, help="Answers that are remembered.")] = 10_000,
    show_frames: Annotated[
        bool, typer.Option("--show-frames", help="Show the last frames on the status page.")
    ] = False,
    grace: Annotated[float, typer.Option(min=0, help="Seconds to finish requests when told to stop.")] = 8.0,
    announce: Annotated[Path | None, typer.Option(help="File to write the URL to, once it is served.")] = None,
    until_eof: Annotated[bool, typer.Option("--until-eof", help="Stop when standard input ends.")] = False,
) -> None:
    """Serve subgoals until stopped by Ctrl+C or SIGTERM.

    Each option may also be given in the environment, as THINKNAV_SERVER_SERVE_<OPTION>, or in the settings file.
    """
    for signal_number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(signal_number, _leave)
    if until_eof:
        stop_at_end_of_input()
    configure_logs(process.log_level, process.log_format)
    if announce and not announce.parent.is_dir():
        raise refused(f"--announce names a file in {announce.parent}, which is no folder")
    if announce and announce.is_dir():
        raise refused(f"--announce {announce} is a folder; name a file")
    if announce and not os.access(announce.parent, os.W_OK):
        raise refused(f"--announce names a file in {announce.parent}, which may not be written to")
    try:
        settings = Settings(
            max_batch=max_batch,
            max_wait=max_wait,
            queue_size=queue_size,
            cache_size=cache_size,
            limits=limits,
            show_frames=show_frames,
        )
        service = PlanningService(_host(planner, process), settings)
        opened = open_doors(service, doors)
    except ValidationError as error:
        raise refused(describe(error)) from None
    except (ValueError, OSError) as error:
        raise refused(str(error)) from None
    what = f"planner {service.info.identity}"
    run(opened.app, opened.listener, announce, what, partial(service.drain, grace), opened.tls)


@app.command()
@takes(planner=planner_options, process=process_settings)
def check(
    planner: PlannerOptions,
    process: ProcessSettings,
    _config: SettingsFile = None,
    goal: Annotated[str, typer.Option(help="What to ask the way to.")] = "chair",
    image: Annotated[Path | None, typer.Option(help="JPEG or PNG file to show; a painted one without.")] = None,
) -> None:
    """Load the planner, ask it about one frame twice, and print the time of each stage.

    A settings file of `serve` will do: what only that understands is passed over.
    """
    configure_logs(process.log_level, process.log_format)
    try:
        for stage in check_planner(partial(_host, planner, process), goal, image):
            typer.echo(f"{stage.name:20} {1000 * stage.seconds:10.2f} ms  {stage.result}".rstrip())
    except ValidationError as error:
        raise refused(describe(error)) from None
    except (ValueError, OSError, PlannerError) as error:
        raise refused(str(error)) from None


def main() -> None:
    """The console script."""
    app()


def _host(planner: PlannerOptions, process: ProcessSettings) -> Host:
    """The planner, loaded. Raises ValueError saying why it cannot be."""
    if planner.planner == "scripted":
        thinker = load_thinker(planner)
        return PlannerThread(thinker.planner, thinker.text_encoder)
    if planner.planner == "openai":
        from thinknav_server.planners.openai import OpenAIPlanner

        return PlannerInLoop(OpenAIPlanner(planner.openai), load_text_encoder(planner), planner.openai.concurrency)
    return PlannerProcess(planner, process)


def _leave(_signal: int, _frame: FrameType | None) -> None:
    """Being told to stop is no failure. Uvicorn stops gracefully, then raises the signal again: to here."""
    raise SystemExit(0)
