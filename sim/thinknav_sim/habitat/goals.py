"""The goals of our scenes as Habitat's files have them: each object with the places from which it is seen.

Our success zones are Habitat's viewpoints, so that distances to either are the same. Knows nothing of files on disk.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode, EpisodeError, find_goals
from thinknav_sim.habitat.convert import to_habitat
from thinknav_sim.habitat.rotation import rotation_of
from thinknav_sim.habitat.schema import AgentState, HabitatFile, HabitatGoal, ViewPoint
from thinknav_sim.navigation import Goal, GoalObject, NavigationGrid, distance_field
from thinknav_sim.navigation.visibility import sees_points
from thinknav_sim.render import Renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene
from thinknav_sim.task_config import ObjectNavConfig

_DECIMALS = 5  # as Habitat's own files


@dataclass(frozen=True)
class SceneGoals:
    """What can be looked for in a scene, and how far each object is from everywhere.

    goals: by category, in Habitat's form. distances: by category, object id and walking distance to its viewpoints.
    """

    grid: NavigationGrid
    goals: dict[str, tuple[HabitatGoal, ...]]
    distances: dict[str, tuple[tuple[int, NDArray[np.float32]], ...]]

    @classmethod
    def of(
        cls, scene: Scene, grid: NavigationGrid, renderer: Renderer, config: ObjectNavConfig = ObjectNavConfig()
    ) -> "SceneGoals":
        """Look at every object of a scene from every cell of its success zone."""
        found = [goal for goal in find_goals(scene, grid, config, renderer) if goal.objects]
        scene_id = renderer.add_scene(scene)
        try:
            goals = {
                goal.category: tuple(
                    _goal(scene, grid, renderer, scene_id, seen, config.camera_height) for seen in goal.objects
                )
                for goal in found
            }
        finally:
            renderer.remove_scene(scene_id)
        return cls(grid, goals, {goal.category: _distances(grid, goal) for goal in found})

    def closest(self, episode: Episode) -> int:
        """The id of the object of the episode's category that is nearest to its start by walking.

        Raises EpisodeError where the start or the goals are not in this scene.
        """
        start = np.array([episode.start_position], np.float64)
        if episode.object_category not in self.distances or not self.grid.is_navigable(start)[0]:
            raise EpisodeError(
                f"episode {episode.episode_id!r} does not fit scene {self.grid.scene_name!r}: its start is not "
                f"navigable there, or no {episode.object_category} can be reached"
            )
        (row,), (col,) = self.grid.cells(start)
        return min(self.distances[episode.object_category], key=lambda pair: float(pair[1][row, col]))[0]

    def file(self, episodes: Sequence[Episode]) -> HabitatFile:
        """A content file: these episodes, all of this scene, with all goals of the scene."""
        written = tuple(to_habitat(episode, self.closest(episode)) for episode in episodes)
        return HabitatFile.model_validate(
            {
                "goals_by_category": {
                    f"{self.grid.scene_name}_{category}": goals for category, goals in self.goals.items()
                },
                "episodes": written,
                **category_ids(),
            }
        )


def category_ids() -> dict[str, dict[str, int]]:
    """What every file says of categories: our ids are those of HM3D ObjectNav."""
    ids = {category: index for index, category in enumerate(GOAL_CATEGORIES)}
    return {"category_to_task_category_id": ids, "category_to_scene_annotation_category_id": ids}


def _distances(grid: NavigationGrid, goal: Goal) -> tuple[tuple[int, NDArray[np.float32]], ...]:
    return tuple((seen.instance.object_id, distance_field(grid, seen.zone)) for seen in goal.objects)


def _goal(
    scene: Scene, grid: NavigationGrid, renderer: Renderer, scene_id: int, seen: GoalObject, camera_height: float
) -> HabitatGoal:
    instance, feet = seen.instance, grid.positions(*np.nonzero(seen.zone))
    eyes = feet + np.array([0.0, camera_height, 0.0])
    shares = sees_points(renderer, scene_id, scene.triangle_objects, eyes, seen.points, instance.object_id).mean(axis=1)
    ahead = instance.box.center - feet
    headings = np.arctan2(-ahead[:, 0], -ahead[:, 2])
    return HabitatGoal.model_validate(
        {
            "position": _rounded(instance.box.center),
            "radius": None,
            "object_id": instance.object_id,
            "object_name": f"{instance.category}_{instance.object_id}",
            "object_name_id": None,
            "object_category": instance.category,
            "room_id": None,
            "room_name": None,
            "view_points": tuple(
                ViewPoint(
                    agent_state=AgentState(position=_rounded(position), rotation=_rounded(rotation_of(float(heading)))),
                    iou=round(float(share), _DECIMALS),
                )
                for position, heading, share in zip(feet, headings, shares, strict=True)
            ),
        }
    )


def _rounded(values: Sequence[float] | NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(round(float(value), _DECIMALS) + 0.0 for value in values)
