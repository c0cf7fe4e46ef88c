"""Writes `report.html`: one self-contained page about a run. Reads the run's folder and draws the rest."""

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2

from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.evaluate import EpisodeRecord, read_evaluation
from thinknav_trainer.report.asks import asking_situations, draw_asks
from thinknav_trainer.report.curves import draw_curve, panels
from thinknav_trainer.report.floor_map import draw_floor_map, draw_path
from thinknav_trainer.report.replies import what_it_was_told
from thinknav_trainer.report.video import Played, to_png, write_video
from thinknav_trainer.run import RunError, read_config, read_metrics
from thinknav_trainer.scenes import make_homes

ROWS = (
    ("success", "success"),
    ("spl", "SPL"),
    ("soft_spl", "SoftSPL"),
    ("sot", "SOT (success weighted by time)"),
    ("distance_to_goal", "distance to goal at the end, m"),
    ("steps", "steps of an episode"),
    ("think_rate", "share of steps spent thinking"),
    ("think_loops", "share of steps in think–agree loops"),
)


def write_report(folder: Path) -> Path:
    """Draw curves, map and video of an evaluated run; the page's path. Raises RunError."""
    config = read_config(folder)
    metrics = read_metrics(folder)
    evaluations = [
        read_evaluation(path.parent) for path in sorted((folder / "evaluations").glob("*-held_out*/result.json"))
    ]
    if not evaluations:
        raise RunError(
            f"{folder} has no evaluation on held-out episodes to report; run thinknav eval on one of its checkpoints"
        )
    if not metrics:
        raise RunError(f"{folder}/metrics.jsonl is empty: nothing was trained")
    chosen = choose_episode(evaluations[-1][1])
    scenes = make_homes(config).scenes
    figures = _draw(folder, config, scenes, chosen, evaluations[-1][1])
    page = _template().render(
        config=config,
        run=folder.name,
        homes=len(scenes),
        curves=[draw_curve(metrics, panel) for panel in panels(metrics)],
        columns=[_column(result) for result, _ in evaluations],
        rows=ROWS,
        failures=_failures([result["failures"] for result, _ in evaluations]),
        planner=(evaluations[-1][0]["protocol"]["planner"] or "").partition("@")[0],
        steps=int(metrics[-1]["steps"]),
        thoughts=metrics[-1],
        episode=chosen,
        budget_curves=_budget_curves(folder),
        subgoals=[(step, subgoal) for step, subgoal in chosen.thoughts][:12],
        **figures,
    )
    path = folder / "report.html"
    path.write_text(page)
    return path


def choose_episode(records: Sequence[EpisodeRecord]) -> EpisodeRecord:
    """One that shows something: found, with thoughts on the way and a long one; else the nearest miss."""

    def worth(record: EpisodeRecord) -> tuple[bool, bool, float]:
        measures = record.measures
        found = bool(measures["success"])
        return found, bool(record.thoughts), measures["shortest_path_length" if found else "soft_spl"]

    return max(records, key=worth)


def _draw(
    folder: Path,
    config: TrainConfig,
    scenes: Sequence[Scene],
    record: EpisodeRecord,
    records: Sequence[EpisodeRecord],
) -> dict[str, Any]:
    """Map and video of an episode as data URIs; of all episodes in its home, where and when they asked."""
    scene = next(scene for scene in scenes if scene.name == record.scene)
    renderer = make_renderer()
    grid = make_grid(scene, renderer, config.env)
    floor_map = draw_floor_map(scene, renderer, grid, config.env.agent_radius)
    thoughts = dict(record.thoughts)
    picture = to_png(draw_path(floor_map, scene, record.category, record.path, list(thoughts)))
    (folder / "map.png").write_bytes(picture)
    video = folder / "videos" / "episode.mp4"
    video.parent.mkdir(exist_ok=True)
    ending = "found it" if record.measures["success"] else "did not find it"
    write_video(video, Played(scene, record.category, record.path, thoughts, ending), renderer, floor_map)
    here = [other for other in records if other.scene == record.scene]
    asks = to_png(draw_asks(floor_map, here))
    (folder / "asks.png").write_bytes(asks)
    return {
        "asks_uri": "data:image/png;base64," + base64.b64encode(asks).decode(),
        "situations": asking_situations(here, scene, grid),
        "told": what_it_was_told(here),
        "episodes_here": len(here),
        "map_uri": "data:image/png;base64," + base64.b64encode(picture).decode(),
        "video_uri": "data:video/mp4;base64," + base64.b64encode(video.read_bytes()).decode(),
    }


def _budget_curves(folder: Path) -> str:
    """The last figure of `thinknav budgets`; nothing without one."""
    figures = sorted(folder.glob("budgets/*/curves.svg"))
    return figures[-1].read_text() if figures else ""


def _column(result: dict[str, Any]) -> dict[str, Any]:
    steps = result["protocol"]["checkpoint_steps"]
    title = "untrained" if steps == 0 else f"after {steps:,} steps"
    if result["protocol"]["actions"] == "greedy":
        title += ", the likeliest actions"
    return {"title": title, "summary": result["summary"], "episodes": result["protocol"]["episodes"]}


def _failures(counts: Sequence[dict[str, int]]) -> list[tuple[str, list[int]]]:
    """A row for each cause of failure that occurs: its words, and how often in each evaluation."""
    causes = sorted({cause for column in counts for cause in column})
    return [(cause.replace("_", " "), [column.get(cause, 0) for column in counts]) for cause in causes]


def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("thinknav_trainer.report", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template("report.html")
