"""The homes of a run and their episodes, split into training and held-out ones.

Knows configuration and simulator; nothing of learning.
"""

from dataclasses import dataclass

from thinknav_sim.episodes import Episode, make_episodes, split_by_category
from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Renderer, make_renderer
from thinknav_sim.scene import Scene
from thinknav_trainer.config import TrainConfig


@dataclass(frozen=True)
class Homes:
    """Scenes with their training and held-out episodes."""

    scenes: list[Scene]
    train: list[Episode]
    held_out: list[Episode]


def make_homes(config: TrainConfig) -> Homes:
    """Generate homes and episodes. They follow `config.scenes` alone: every seed of a run meets the same ones."""
    wanted = config.scenes
    scenes = [
        generate_home(home_seed("train", wanted.first_home + index), rooms=wanted.rooms)
        for index in range(wanted.homes)
    ]
    renderer = make_renderer()
    episodes: list[Episode] = []
    for index, scene in enumerate(scenes):
        episodes += make_episodes(
            scene,
            make_grid(scene, renderer, config),
            wanted.episodes,
            seed=wanted.first_home + index,
            min_distance=wanted.min_distance,
            max_distance=wanted.max_distance,
            config=config.env,
            renderer=renderer,
        )
    train, held_out = split_by_category(episodes, held_out=wanted.held_out, seed=0)
    return Homes(scenes, list(train), list(held_out))


def make_grid(scene: Scene, renderer: Renderer, config: TrainConfig) -> NavigationGrid:
    """Where the configuration's agent can stand in a scene."""
    return NavigationGrid.from_scene(scene, renderer, radius=config.env.agent_radius, height=config.env.agent_height)
