"""The scenes and episodes of an ObjectNav task, prepared once and shared by all agents.

Holds no agent's state: `vector_env` moves agents through it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode, EpisodeError
from thinknav_sim.navigation import FieldTable, Goal, GridTable, NavigationGrid, find_goal
from thinknav_sim.render import Renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene, SceneError
from thinknav_sim.success import at_viewpoint, faces_goal, goal_bearings
from thinknav_sim.task_config import ObjectNavConfig

# A start farther than this from the floor stands on another one.
_SAME_FLOOR_M = 0.5
# Starts that another program drew may stand this far off our grid, a cell of its own; they are moved onto it.
_START_TOLERANCE_M = 0.1


def make_grid(
    scene: Scene, renderer: Renderer, config: ObjectNavConfig, floor_height: float | None = None
) -> NavigationGrid:
    """Where the task's agent can stand in a scene; see `NavigationGrid.from_scene`."""
    return NavigationGrid.from_scene(
        scene, renderer, radius=config.agent_radius, height=config.agent_height, floor_height=floor_height
    )


def is_of_played_storey(scene: Scene, grid: NavigationGrid, position: NDArray[np.float64]) -> bool:
    """Whether a position (3,) has the height of the floor that is played on there, whatever stands in its place.

    Where nobody can stand, its storey is the scene's that is nearest in height. grid: the scene's.
    """
    if abs(position[1] - _floor_at(grid, position)) > _SAME_FLOOR_M:
        return False
    nearest = min(scene.floors, key=lambda level: abs(level - position[1]))
    return nearest == scene.floors[0] or float(grid.snap(position[None])[1][0]) <= _START_TOLERANCE_M


def _floor_at(grid: NavigationGrid, position: NDArray[np.float64]) -> float:
    """Height of the floor at the navigable place that is nearest, seen from above, to a position (3,)."""
    (row,), (col,) = grid.cells(grid.snap(position[None])[0])
    return float(grid.floor[row, col])


@dataclass(frozen=True)
class PreparedScene:
    """A scene, its grid, and the goals that were asked for. scene_id: the renderer's."""

    scene: Scene
    scene_id: int
    grid: NavigationGrid
    goals: dict[str, Goal] = field(default_factory=dict)


@dataclass(frozen=True)
class EpisodeTable:
    """E episodes as arrays.

    scene: (E,) index of the scene. field: (E,) index into the FieldTable. goal: (E,) index into GOAL_CATEGORIES.
    start: (E, 4) start poses.
    """

    scene: NDArray[np.int64]
    field: NDArray[np.int64]
    goal: NDArray[np.int64]
    start: NDArray[np.float64]


class ObjectNavWorld:
    """Prepared scenes, their distance fields, and the episodes in them.

    Only the categories that episodes ask for are prepared; others are when first asked for.
    Raises EpisodeError for an episode that cannot be played, SceneError for a scene nobody can stand in or two of one
    name.
    """

    def __init__(
        self, scenes: Sequence[Scene], episodes: Sequence[Episode], config: ObjectNavConfig, renderer: Renderer
    ) -> None:
        if not episodes:
            raise EpisodeError("there are no episodes to play")
        self.config = config
        self.renderer = renderer
        self.episodes = tuple(episodes)
        self.prepared: list[PreparedScene] = []
        try:
            self._prepare_all(scenes)
        except BaseException:
            self.close()
            raise

    def _prepare_all(self, scenes: Sequence[Scene]) -> None:
        index_of: dict[str, int] = {}
        for index, scene in enumerate(scenes):
            if index_of.setdefault(scene.name, index) != index:
                raise SceneError(f"two scenes are called {scene.name!r}")
            self.prepared.append(self._prepare(scene))
        self._check_episodes(index_of)
        pairs = sorted({(index_of[e.scene_name], e.object_category) for e in self.episodes})
        field_of = {pair: number for number, pair in enumerate(pairs)}
        self.grids = GridTable.of([prepared.grid for prepared in self.prepared])
        self.fields = FieldTable.of(
            [self.goal(scene, category).distance for scene, category in pairs], [scene for scene, _ in pairs]
        )
        keys = [(index_of[e.scene_name], e.object_category) for e in self.episodes]
        self.table = EpisodeTable(
            scene=np.array([scene for scene, _ in keys], np.int64),
            field=np.array([field_of[key] for key in keys], np.int64),
            goal=np.array([GOAL_CATEGORIES.index(category) for _, category in keys], np.int64),
            start=np.stack([self._start_pose(e, index_of[e.scene_name]) for e in self.episodes]),
        )
        self.scene_ids = np.array([prepared.scene_id for prepared in self.prepared], np.int64)

    def _prepare(self, scene: Scene) -> PreparedScene:
        grid = make_grid(scene, self.renderer, self.config)
        return PreparedScene(scene, self.renderer.add_scene(scene), grid)

    def _check_episodes(self, index_of: dict[str, int]) -> None:
        for episode in self.episodes:
            who = f"episode {episode.episode_id!r}"
            if episode.scene_name not in index_of:
                raise EpisodeError(f"{who} plays in scene {episode.scene_name!r}, which is not among the scenes given")
            if episode.object_category not in GOAL_CATEGORIES:
                raise EpisodeError(
                    f"{who} has the goal {episode.object_category!r}, which is not one of {', '.join(GOAL_CATEGORIES)}"
                )
            scene_index = index_of[episode.scene_name]
            if not self.prepared[scene_index].scene.objects_of(episode.object_category):
                raise EpisodeError(f"{who}: scene {episode.scene_name!r} has no {episode.object_category}")
            if not self.goal(scene_index, episode.object_category).objects:
                raise EpisodeError(
                    f"{who}: no {episode.object_category} of scene {episode.scene_name!r} can be seen from within "
                    f"{self.config.success_distance} m of walking"
                )

    def _start_pose(self, episode: Episode, scene_index: int) -> NDArray[np.float64]:
        grid = self.grid(scene_index)
        start = np.array(episode.start_position, np.float64)
        finite = bool(np.isfinite([*start, episode.start_heading]).all())
        (snapped,), (moved,) = grid.snap(np.where(np.isfinite(start), start, 0.0)[None])
        if not finite or moved > _START_TOLERANCE_M:
            raise EpisodeError(
                f"episode {episode.episode_id!r} starts at {episode.start_position}, heading {episode.start_heading}, "
                f"where an agent cannot stand in scene {episode.scene_name!r}"
            )
        floor = _floor_at(grid, start)
        if abs(start[1] - floor) > _SAME_FLOOR_M:
            raise EpisodeError(
                f"episode {episode.episode_id!r} starts at height {start[1]:.2f} m, but the floor of scene "
                f"{episode.scene_name!r} that is played on is at {floor:.2f} m"
            )
        return np.array([snapped[0], floor, snapped[2], episode.start_heading])

    def grid(self, scene_index: int) -> NavigationGrid:
        """The navigation grid of a scene."""
        return self.prepared[scene_index].grid

    def goal(self, scene_index: int, category: str) -> Goal:
        """A category's zones and walking distances in a scene; kept once computed."""
        prepared = self.prepared[scene_index]
        if category not in prepared.goals:
            prepared.goals[category] = find_goal(
                prepared.scene,
                prepared.grid,
                self.renderer,
                prepared.scene_id,
                category,
                success_distance=self.config.success_distance,
                camera_height=self.config.camera_height,
            )
        return prepared.goals[category]

    def goal_bearings(self, episode_index: int, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where an agent in the success zone of the episode's goal sees it: see `success.goal_bearings`."""
        scene_index = int(self.table.scene[episode_index])
        prepared = self.prepared[scene_index]
        goal = self.goal(scene_index, self.episodes[episode_index].object_category)
        return goal_bearings(
            prepared.scene,
            prepared.grid,
            self.renderer,
            prepared.scene_id,
            goal,
            pose,
            self.config.camera_height,
        )

    def is_success(self, episode_index: int, pose: NDArray[np.float64], distance_to_goal: float) -> bool:
        """Whether an agent that stops in this pose (4,) has found the episode's goal, by the configured rule."""
        if self.config.success == "viewpoint":
            return at_viewpoint(distance_to_goal)
        return faces_goal(self.goal_bearings(episode_index, pose), self.config.hfov)

    def close(self) -> None:
        """Take the scenes out of the renderer."""
        for prepared in self.prepared:
            self.renderer.remove_scene(prepared.scene_id)
        self.prepared.clear()
