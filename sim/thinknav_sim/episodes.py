"""Episodes: where an agent starts and what it is to find; making them and splitting them.

The fields are those of Habitat's ObjectNav episodes. Knows nothing of how an episode is played.
"""

import math
import zlib
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.navigation import Goal, NavigationGrid, find_goal
from thinknav_sim.render import Renderer, make_renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene
from thinknav_sim.task_config import ObjectNavConfig


class EpisodeError(ValueError):
    """An episode that cannot be made or played; the message names it and says why."""


@dataclass(frozen=True)
class Episode:
    """One task: from here, find that.

    start_position: x, y, z of the agent's feet, metres. start_heading: radians, counter-clockwise from -z.
    geodesic_distance: walking distance from the start to the nearest point that counts as there; euclidean_distance:
    the straight one. Both in metres, for choosing among episodes: the environment measures for itself.
    """

    episode_id: str
    scene_name: str
    start_position: tuple[float, float, float]
    start_heading: float
    object_category: str
    geodesic_distance: float
    euclidean_distance: float


def make_episodes(
    scene: Scene,
    grid: NavigationGrid,
    count: int,
    seed: int,
    min_distance: float = 1.0,
    max_distance: float = 30.0,
    *,
    config: ObjectNavConfig = ObjectNavConfig(),
    renderer: Renderer | None = None,
) -> tuple[Episode, ...]:
    """Make episodes in a scene, its reachable goal categories in turn.

    Starts are uniform over the cells from which the walk to the goal's success zone is `min_distance` to `max_distance`
    long, headings uniform. The same arguments give the same episodes.
    config: the task they are for. renderer: for lines of sight (one is made unless given).
    Raises EpisodeError when no goal can be reached from such a distance.
    """
    if not 0 < min_distance < max_distance:
        raise ValueError(f"min_distance {min_distance} must be positive and less than max_distance {max_distance}")
    starts = {}
    for goal in find_goals(scene, grid, config, renderer or make_renderer()):
        far_enough = (goal.distance >= min_distance) & (goal.distance <= max_distance) & grid.navigable
        if far_enough.any():
            starts[goal.category] = (goal, far_enough)
    if not starts:
        raise EpisodeError(
            f"scene {scene.name!r} has no goal that can be reached from {min_distance} to {max_distance} m away; "
            f"it has these objects: {sorted({instance.category for instance in scene.objects})}"
        )
    rng = np.random.default_rng((seed, zlib.crc32(scene.name.encode())))
    categories = list(starts)
    episodes = []
    for number in range(count):
        goal, mask = starts[categories[number % len(categories)]]
        position = grid.random_positions(rng, mask, 1)[0]
        heading = float(rng.uniform(-math.pi, math.pi))
        episodes.append(_episode(f"{scene.name}-{seed}-{number}", scene, grid, goal, position, heading))
    return tuple(episodes)


def find_goals(scene: Scene, grid: NavigationGrid, config: ObjectNavConfig, renderer: Renderer) -> list[Goal]:
    """The goal categories that a scene has objects of; their `objects` are none where none can be reached."""
    present = [category for category in GOAL_CATEGORIES if scene.objects_of(category)]
    scene_id = renderer.add_scene(scene)
    try:
        goals = [
            find_goal(
                scene,
                grid,
                renderer,
                scene_id,
                category,
                success_distance=config.success_distance,
                camera_height=config.camera_height,
            )
            for category in present
        ]
    finally:
        renderer.remove_scene(scene_id)
    return goals


def _episode(
    episode_id: str,
    scene: Scene,
    grid: NavigationGrid,
    goal: Goal,
    position: NDArray[np.float64],
    heading: float,
) -> Episode:
    (row,), (col,) = grid.cells(position[None])
    straight = np.linalg.norm(grid.positions(*np.nonzero(goal.zone)) - position, axis=1).min()
    x, y, z = (float(value) for value in position)
    return Episode(
        episode_id=episode_id,
        scene_name=scene.name,
        start_position=(x, y, z),
        start_heading=heading,
        object_category=goal.category,
        geodesic_distance=float(goal.distance[row, col]),
        euclidean_distance=float(straight),
    )


def split_by_category(
    episodes: Sequence[Episode], held_out: float = 0.1, seed: int = 0
) -> tuple[tuple[Episode, ...], tuple[Episode, ...]]:
    """Split into those to train on and those held out, alike in categories and scenes; order is kept.

    held_out: the share to hold out, between 0 and 1. Every category gives its share of episodes within one, and so does
    the whole; the episodes of a category are drawn evenly from its scenes.
    """
    if not 0 <= held_out <= 1:
        raise ValueError(f"held_out must be a share between 0 and 1, not {held_out}")
    groups: defaultdict[tuple[str, str], list[int]] = defaultdict(list)
    for index, episode in enumerate(episodes):
        groups[episode.object_category, episode.scene_name].append(index)
    rng = np.random.default_rng(seed)
    # Line the groups up, shuffled within, and hold out every so manieth episode of the line: each group, category and
    # scene that lies together in it then gives its share to within one.
    line = np.array([index for key in sorted(groups) for index in rng.permutation(groups[key])], np.int64)
    offset = rng.uniform()
    marks = np.floor(np.arange(len(line) + 1) * held_out + offset)
    held = set(line[np.diff(marks) > 0].tolist())
    return (
        tuple(episode for index, episode in enumerate(episodes) if index not in held),
        tuple(episode for index, episode in enumerate(episodes) if index in held),
    )
