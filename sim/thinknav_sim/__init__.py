"""ThinkNav's simulator: homes to look for objects in, drawn and stepped in batches.

Importing it registers "ThinkNav/ObjectNav-v0" with Gymnasium.
"""

import gymnasium

from thinknav_sim.env import ENV_ID, ObjectNavEnv, make_vector_env
from thinknav_sim.episodes import Episode, EpisodeError, make_episodes, split_by_category
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.scene import GOAL_CATEGORIES, Scene, SceneError
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

__all__ = [
    "ENV_ID",
    "GOAL_CATEGORIES",
    "Action",
    "Episode",
    "EpisodeError",
    "NavigationGrid",
    "ObjectNavConfig",
    "ObjectNavEnv",
    "ObjectNavVectorEnv",
    "Scene",
    "SceneError",
    "make_episodes",
    "make_vector_env",
    "split_by_category",
]

gymnasium.register(
    ENV_ID, entry_point="thinknav_sim.env:ObjectNavEnv", vector_entry_point="thinknav_sim.env:make_vector_env"
)
