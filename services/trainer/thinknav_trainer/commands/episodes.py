"""`thinknav episodes`: make episode files in Habitat's format, and check such files."""

import math
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from thinknav_sim.habitat import from_habitat, read_dataset
from thinknav_sim.homes import SEEDS
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.config import ConfigError
from thinknav_trainer.simple_homes import EpisodesWanted, check_is_free, rank_homes, write_episodes

app = typer.Typer(help="Make and check files of episodes, in Habitat's ObjectNav format.", no_args_is_help=True)


@app.command()
def make(
    output: Annotated[Path, typer.Option(help="folder to write into, new or empty")],
    homes: Annotated[int, typer.Option(min=1, help="how many homes to take, those that are simplest to walk")] = 5,
    among: Annotated[int, typer.Option(min=1, help="how many homes to choose from")] = 20,
    first_home: Annotated[int, typer.Option(min=0, help="index of the first of them in the training range")] = 0,
    rooms: Annotated[int | None, typer.Option(min=1, max=8, help="of each home; default: the home decides")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="to make in each home, before the split")] = 400,
    held_out: Annotated[float, typer.Option(min=0.0, max=1.0, help="share held out, alike in every category")] = 0.1,
    min_distance: Annotated[float, typer.Option(help="shortest way from start to goal, metres")] = 1.0,
    max_distance: Annotated[float, typer.Option(help="longest way from start to goal, metres")] = 30.0,
) -> None:
    """Choose the simplest of many procedural homes, make episodes in them, and write both splits."""
    if homes > among:
        raise ConfigError(f"--homes {homes} cannot be chosen among {among}; make --among at least {homes}")
    last_home = len(SEEDS["train"]) - 1
    if first_home + among - 1 > last_home:
        raise ConfigError(f"--first-home {first_home} with --among {among} goes beyond the last home, {last_home}")
    if not 0 < min_distance < max_distance < math.inf:
        raise ConfigError(
            f"--min-distance {min_distance} must be positive and below --max-distance {max_distance}, a finite length"
        )
    check_is_free(output)
    config = ObjectNavConfig()
    ranked = rank_homes(range(first_home, first_home + among), rooms, config)
    wanted = EpisodesWanted(episodes, held_out, min_distance, max_distance)
    splits = write_episodes(ranked, homes, wanted, config, output)
    table = Table("home", "navigation complexity", *(f"{name} episodes" for name in splits))
    for candidate in ranked[:homes]:
        counts = (str(len(dataset.content[candidate.name].episodes)) for dataset in splits.values())
        table.add_row(candidate.name, f"{candidate.complexity:.2f}", *counts)
    Console(markup=False).print(table)
    for name in splits:
        typer.echo(f"{name}: {output / name / f'{name}.json.gz'}")


@app.command()
def check(path: Annotated[Path, typer.Argument(help="a .json or .json.gz file, or the folder of a split")]) -> None:
    """Read episode files, with the content files beside them, and say what is in them or what is wrong."""
    dataset = read_dataset(path)
    read = [from_habitat(episode) for episode in dataset.episodes]
    for file in dataset.files:
        for episode in file.episodes:
            if not any(goal.view_points for goal in file.goals_of(episode)):
                raise ConfigError(f"{path}: episode {episode.episode_id!r} has no goal with viewpoints in its file")
    table = Table("goal", "episodes", "mean walking distance", title=f"{len(read)} episodes", title_justify="left")
    for category, count in sorted(Counter(episode.object_category for episode in read).items()):
        mean = sum(e.geodesic_distance for e in read if e.object_category == category) / count
        table.add_row(category, str(count), f"{mean:.2f} m")
    Console(markup=False).print(table)
    typer.echo(f"scenes: {', '.join(sorted({episode.scene_name for episode in read}))}")
