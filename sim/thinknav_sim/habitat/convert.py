"""Our episodes and Habitat's: the same task in two notations. Knows nothing of files, and measures nothing."""

import sys

from thinknav_sim.episodes import Episode, EpisodeError
from thinknav_sim.habitat.rotation import heading_of, rotation_of
from thinknav_sim.habitat.schema import HabitatEpisode

# The first part of the scene_id of scenes that have no file.
SCENE_FOLDER = "thinknav"


def from_habitat(episode: HabitatEpisode) -> Episode:
    """Our episode. Its scene is called as Habitat's content files are: "TEEsavR23oF".

    Raises EpisodeError for one whose info lacks the distances, or has some that are negative or not finite.
    """
    distances = []
    for key in ("geodesic_distance", "euclidean_distance"):
        value = (episode.info or {}).get(key)
        # Compared with the largest float, so that no whole number is too large for one.
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= sys.float_info.max:
            raise EpisodeError(f"episode {episode.episode_id!r}: info.{key} must be a number of metres, not {value!r}")
        distances.append(float(value))
    return Episode(
        episode_id=str(episode.episode_id),
        scene_name=episode.scene_name,
        start_position=episode.start_position,
        start_heading=heading_of(episode.start_rotation),
        object_category=episode.object_category,
        geodesic_distance=distances[0],
        euclidean_distance=distances[1],
    )


def to_habitat(episode: Episode, closest_goal_object_id: int | str) -> HabitatEpisode:
    """Habitat's episode, with the keys that habitat-lab's `ObjectGoalNavEpisode` takes and no others.

    closest_goal_object_id: the object that is nearest to the start by walking.
    """
    return HabitatEpisode.model_validate(
        {
            "episode_id": episode.episode_id,
            "scene_id": f"{SCENE_FOLDER}/{episode.scene_name}",
            "scene_dataset_config": "default",
            "additional_obj_config_paths": [],
            "start_position": episode.start_position,
            "start_rotation": rotation_of(episode.start_heading),
            "info": {
                "geodesic_distance": episode.geodesic_distance,
                "euclidean_distance": episode.euclidean_distance,
                "closest_goal_object_id": closest_goal_object_id,
            },
            "goals": [],
            "start_room": None,
            "shortest_paths": None,
            "object_category": episode.object_category,
        }
    )
