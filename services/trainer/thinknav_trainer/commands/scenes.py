"""`thinknav scenes`: bring scans of real homes in, and see what was understood of them."""

import contextlib
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Annotated, cast, get_args

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import Renderer, make_renderer
from thinknav_sim.scans import Scan, ScanOptions, Units, UpAxis, load_scan, write_scene
from thinknav_sim.scene import GOAL_CATEGORIES, Scene, SceneError
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.report.scene_picture import draw_scene

app = typer.Typer(help="Scans of real homes: GLB, OBJ, PLY, HM3D folders.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keeps `import` a command of its own, whatever else joins it."""


@app.command("import")
def import_scene(
    path: Annotated[Path, typer.Argument(help="a GLB, OBJ or PLY file, or an HM3D folder of one scene")],
    units: Annotated[
        str | None, typer.Option(help=f"of the file: {', '.join(get_args(Units))}; default: guess")
    ] = None,
    up_axis: Annotated[str | None, typer.Option(help="y or z; default: guess, and say so")] = None,
    decimate: Annotated[int | None, typer.Option(metavar="N", help="keep about N triangles")] = None,
    semantics: Annotated[Path | None, typer.Option(help="labels: JSON of boxes, or a painted .semantic.glb")] = None,
    output: Annotated[Path, typer.Option(help="folder of the scene and its picture")] = Path("scenes"),
) -> None:
    """Import a scan, print what is in it, and write OUTPUT/NAME.npz, to train in, and OUTPUT/NAME.png, to look at."""
    options = ScanOptions(cast(Units | None, units), cast(UpAxis | None, up_axis), decimate, semantics)
    start = time.perf_counter()
    scan = load_scan(path, options)
    seconds = time.perf_counter() - start
    scene = scan.scene
    config = ObjectNavConfig()
    renderer = make_renderer()
    grids = _grids(scene, renderer, config)
    picture = draw_scene(replace(scene, floors=tuple(grids)), renderer, list(grids.values()), config.agent_radius)
    console = Console()
    _describe(console, scan, grids, seconds)
    try:
        write_scene(output / f"{scene.name}.npz", scene, scan.notes)
        picture.save(output / f"{scene.name}.png")
    except OSError as error:
        raise SceneError(f"cannot write to {output}: {error.strerror or error}") from None
    console.print(f"scene: {output / f'{scene.name}.npz'}", soft_wrap=True, markup=False)
    console.print(f"picture: {output / f'{scene.name}.png'}", soft_wrap=True, markup=False)


def _grids(scene: Scene, renderer: Renderer, config: ObjectNavConfig) -> dict[float, NavigationGrid]:
    """The grids of the floors by their heights, the one that is played on first; others only where one can stand."""
    grids = {scene.floors[0]: make_grid(scene, renderer, config, scene.floors[0])}
    for level in scene.floors[1:]:
        with contextlib.suppress(SceneError):
            grids[level] = make_grid(scene, renderer, config, level)
    return grids


def _describe(console: Console, scan: Scan, grids: dict[float, NavigationGrid], seconds: float) -> None:
    scene = scan.scene
    console.print(
        f"[bold]{escape(scene.name)}[/bold] ({'from the cache' if scan.cached else 'read'} in {seconds:.2f} s)"
    )
    for note in scan.notes:
        console.print(f"  {note}", soft_wrap=True, markup=False)
    textures = f", {len(scene.textures)} textures" if scene.textures else ""
    console.print(f"  triangles: {len(scene.triangles):,}{textures}")
    width, height, depth = np.ptp(scene.vertices, axis=0)
    console.print(f"  extent: {width:.2f} x {depth:.2f} m, {height:.2f} m high")
    for level in scene.floors:
        grid = grids.get(level)
        if grid is None:
            console.print(f"  floor at {level:.2f} m: left out, too small to stand on")
            continue
        area = float(grid.navigable.sum()) * grid.cell**2
        heights = grid.floor[grid.navigable]
        console.print(
            f"  floor at {level:.2f} m: {area:.1f} m2 navigable, from {heights.min():.2f} to {heights.max():.2f} m"
        )
    counts = Counter(instance.category for instance in scene.objects)
    goals = ", ".join(f"{counts[name]} {name}" for name in GOAL_CATEGORIES if name in counts)
    others = ", ".join(f"{count} {name}" for name, count in counts.most_common() if name not in GOAL_CATEGORIES)
    console.print(f"  goals: {goals or 'none'}", soft_wrap=True, markup=False)
    console.print(f"  other objects: {others or 'none'}", soft_wrap=True, markup=False)
