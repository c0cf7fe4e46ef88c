"""Commands that are imported when they are called, for `--help` and a mistyped name need not wait for torch."""

import importlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import typer
from typer.core import TyperGroup
from typer.main import get_command, get_group


class Lazy(NamedTuple):
    """A command of its own, or a group of them: what is said of it in a list, and where it is.

    place: "module:name" of a function, or of a `typer.Typer`.
    """

    help: str
    place: str

    def load(self, name: str) -> Any:
        """The click command, under a name."""
        module, attribute = self.place.split(":")
        found = getattr(importlib.import_module(module), attribute)
        if isinstance(found, typer.Typer):
            return get_group(found)
        lone = typer.Typer(add_completion=False)
        lone.command(name)(found)
        return get_command(lone)


def lazy_app(commands: Mapping[str, Lazy], **settings: Any) -> typer.Typer:
    """An app of commands by name, in their order. settings: of the `typer.Typer`."""

    class Group(TyperGroup):
        """Lists what stands for the commands, and calls the commands."""

        def resolve_command(self, ctx: Any, args: list[str]) -> Any:
            name, listed, rest = super().resolve_command(ctx, args)
            called = commands[name].load(name) if name else listed
            return name, called, rest

    app = typer.Typer(cls=Group, **settings)
    for name, command in commands.items():
        app.command(name, help=command.help)(_stand_in)
    app.callback()(_stand_in)
    return app


def _stand_in() -> None:
    """Of a command that is not imported yet."""
