"""`thinknav homes`: look at procedural homes."""

from pathlib import Path
from typing import Annotated

import typer

from thinknav_sim.homes import generate_home
from thinknav_trainer.commands.options import check_folder

app = typer.Typer(help="Look at procedural homes.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keeps `show` a command of its own name while it is the only one."""


@app.command()
def show(
    seed: Annotated[int, typer.Argument(min=0, help="of the home")],
    rooms: Annotated[int | None, typer.Option(min=1, max=8, help="default: the seed decides, 3 to 6")] = None,
    output: Annotated[Path, typer.Option(help="folder of the pictures")] = Path(),
) -> None:
    """Write the plan of a home, seen from above with its ceilings cut away, and four views of it, as PNG."""
    from thinknav_trainer.report.home_pictures import write_home_pictures

    check_folder("--output", output)
    scene = generate_home(seed, rooms)
    for path in write_home_pictures(scene, output):
        typer.echo(str(path))
