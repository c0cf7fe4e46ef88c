"""Habitat's ObjectNav episode files: read, written, and turned into our episodes and back.

`schema` is what a file holds, `files` reads and writes them, `convert` goes between the two kinds of episode.
"""

from thinknav_sim.habitat.convert import from_habitat, to_habitat
from thinknav_sim.habitat.files import EpisodeFileError, read_dataset, read_file, write_dataset, write_file
from thinknav_sim.habitat.goals import SceneGoals, category_ids
from thinknav_sim.habitat.rotation import heading_of, rotation_of
from thinknav_sim.habitat.schema import (
    AgentState,
    HabitatDataset,
    HabitatEpisode,
    HabitatFile,
    HabitatGoal,
    ViewPoint,
)

__all__ = [
    "AgentState",
    "EpisodeFileError",
    "HabitatDataset",
    "HabitatEpisode",
    "HabitatFile",
    "HabitatGoal",
    "SceneGoals",
    "ViewPoint",
    "category_ids",
    "from_habitat",
    "heading_of",
    "read_dataset",
    "read_file",
    "rotation_of",
    "to_habitat",
    "write_dataset",
    "write_file",
]
