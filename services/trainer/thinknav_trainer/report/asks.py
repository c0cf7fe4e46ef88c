"""Where and when an agent asks its planner: on the map of a home, and in which situations more often than elsewhere.

Knows records of episodes in one scene, and the scene; nothing of policies.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import Action
from thinknav_trainer.free_heading import BLOCKED_M
from thinknav_trainer.records import EpisodeRecord
from thinknav_trainer.report.floor_map import PATH_COLOR, THOUGHT_COLOR, FloorMap

# Asks this near to one another are one dot, the larger the more there are.
SPOT_M = 0.15
_SMALLEST, _LARGEST = 3.0, 12.0  # radii of dots, pixels

FIRST_STEPS = 10
NEAR_DOORWAY_M = 0.5
# Turned back: looks more than this much elsewhere than it did so many steps before.
TURNED_BACK = np.pi / 2
TURNING_STEPS = 18


@dataclass(frozen=True)
class Situation:
    """steps, asks: the shares of all steps and of all asks that were in it."""

    name: str
    steps: float
    asks: float

    @property
    def ratio(self) -> float:
        """How much more often it asks there than on average; 0 where it never is."""
        return self.asks / self.steps if self.steps else 0.0


def draw_asks(floor_map: FloorMap, records: Sequence[EpisodeRecord]) -> Image.Image:
    """The map with every episode's path, thin, and dots where it asked: their areas go by the number of asks."""
    image = floor_map.image.convert("RGB")
    draw = ImageDraw.Draw(image, "RGBA")
    for record in records:
        points = [floor_map.pixel(pose[0], pose[2]) for pose in record.path]
        if len(points) > 1:
            draw.line(points, fill=(*PATH_COLOR, 150), width=2, joint="curve")
    spots, counts = _spots(records)
    for (x, z), count in zip(spots.tolist(), counts.tolist(), strict=True):
        radius = max(_SMALLEST, _LARGEST * np.sqrt(count / counts.max()))
        column, row = floor_map.pixel(x, z)
        box = (column - radius, row - radius, column + radius, row + radius)
        draw.ellipse(box, fill=(*THOUGHT_COLOR, 170), outline=(40, 40, 40, 220))
    return image


def _spots(records: Sequence[EpisodeRecord]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Places (K, 2) of asks and how many there were at each, the most first so that none hides a smaller one."""
    asked = [
        [pose[0], pose[2]]
        for record in records
        for pose, action in zip(record.path, record.actions, strict=True)
        if action == Action.THINK
    ]
    places = np.array(asked, np.float64).reshape(-1, 2)
    _, which, counts = np.unique(np.round(places / SPOT_M), axis=0, return_inverse=True, return_counts=True)
    which = which.reshape(-1)
    sums = np.stack([np.bincount(which, places[:, axis], len(counts)) for axis in (0, 1)], axis=1)
    order = np.argsort(-counts, kind="stable")
    return (sums / counts[:, None])[order], counts[order].astype(np.int64)


def asking_situations(records: Sequence[EpisodeRecord], scene: Scene, grid: NavigationGrid) -> list[Situation]:
    """Of each situation how common it is, and how many of the asks were in it. None without asks."""
    doorways = doorway_places(scene, grid)
    names: dict[str, list[NDArray[np.bool_]]] = {}
    asks = []
    for record in records:
        poses, actions = np.array(record.path), np.array(record.actions)
        asks.append(actions == Action.THINK)
        found = {
            f"the first {FIRST_STEPS} steps": np.arange(len(actions)) < FIRST_STEPS,
            "just bumped into something": _bumped(poses, actions),
            "just turned back": _turned_back(poses),
            "the goal was in view before": _since(len(actions), record.first_seen),
        }
        if len(doorways):
            found[f"within {NEAR_DOORWAY_M:g} m of a doorway"] = _near(poses, doorways)
        for name, there in found.items():
            names.setdefault(name, []).append(there)
    asked = np.concatenate(asks)
    if not asked.any():
        return []
    return [
        Situation(name, float(there.mean()), float(there[asked].mean()))
        for name, there in ((name, np.concatenate(parts)) for name, parts in names.items())
    ]


def doorway_places(scene: Scene, grid: NavigationGrid) -> NDArray[np.float64]:
    """(K, 2) x and z of where one can walk but is in no room: in doorways. None where rooms are not known."""
    places = grid.positions(*np.nonzero(grid.navigable))[:, [0, 2]]
    if not scene.rooms:
        return places[:0]
    inside = np.zeros(len(places), bool)
    for room in scene.rooms:
        x0, z0, x1, z1 = room.bounds
        x, z = places.T
        inside |= (x >= x0) & (x <= x1) & (z >= z0) & (z <= z1)
    return places[~inside]


def _near(poses: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.bool_]:
    apart = np.linalg.norm(poses[:, None, [0, 2]] - places[None], axis=2)
    near: NDArray[np.bool_] = apart.min(axis=1) <= NEAR_DOORWAY_M
    return near


def _bumped(poses: NDArray[np.float64], actions: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the last step that was no think went forward and led nowhere."""
    walked = np.linalg.norm(np.diff(poses[:, [0, 2]], axis=0), axis=1)
    bumped, last = np.zeros(len(actions), bool), False
    for step in range(1, len(actions)):
        if actions[step - 1] != Action.THINK:
            last = actions[step - 1] == Action.MOVE_FORWARD and walked[step - 1] < BLOCKED_M
        bumped[step] = last
    return bumped


def _turned_back(poses: NDArray[np.float64]) -> NDArray[np.bool_]:
    headings = poses[:, 3]
    before = headings[np.maximum(0, np.arange(len(headings)) - TURNING_STEPS)]
    turned: NDArray[np.bool_] = np.abs(np.angle(np.exp(1j * (headings - before)))) > TURNED_BACK
    return turned


def _since(count: int, first: int | None) -> NDArray[np.bool_]:
    return np.arange(count) >= (count if first is None else first)
