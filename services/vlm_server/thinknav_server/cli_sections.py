"""Options that several commands share, written once: a section is a function whose parameters are options.

    @app.command()
    @takes(planner=planner_options)
    def serve(port: int, *, planner: PlannerOptions) -> None: ...

has the option `--port` and all those of `planner_options`, and is called with what that returns. A section may take
others in the same way.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

import typer
from pydantic import ValidationError

from thinknav_proto import describe

T = TypeVar("T")


def takes(**sections: Callable[..., Any]) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Puts the options of each section in the place of the parameter that bears its name."""

    def decorate(command: Callable[..., T]) -> Callable[..., T]:
        own = [p for p in inspect.signature(command).parameters.values() if p.name not in sections]
        names = {name: list(inspect.signature(section).parameters) for name, section in sections.items()}

        @functools.wraps(command)
        def call(**values: Any) -> T:
            try:
                made = {
                    name: section(**{option: values.pop(option) for option in names[name]})
                    for name, section in sections.items()
                }
            except ValidationError as error:
                raise refused(describe(error)) from None
            return command(**values, **made)

        options = [p for section in sections.values() for p in inspect.signature(section).parameters.values()]
        call.__signature__ = inspect.Signature([*own, *options])  # type: ignore[attr-defined]
        call.__annotations__ = {p.name: p.annotation for p in (*own, *options)}
        return call

    return decorate


def refused(message: str) -> typer.Exit:
    """Tells the user what is wrong; to be raised."""
    typer.echo(f"thinknav-server: {message}", err=True)
    return typer.Exit(1)
