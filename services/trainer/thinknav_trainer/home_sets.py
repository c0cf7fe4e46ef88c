"""Ranges of procedural homes to evaluate in, such as `val:0-20`, and episodes in them.

Knows the simulator; nothing of agents.
"""

import re
from dataclasses import dataclass
from typing import cast

from thinknav_sim.episodes import Episode, make_episodes
from thinknav_sim.homes import SEEDS, Split, generate_home, home_seed
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import GOAL_CATEGORIES, Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.config import ConfigError

_RANGE = re.compile(r"([a-z]+):(\d+)-(\d+)")


@dataclass(frozen=True)
class HomeSet:
    """The homes number `first` up to, not including, `end` of a split."""

    split: Split
    first: int
    end: int

    def __str__(self) -> str:
        return f"{self.split}:{self.first}-{self.end}"

    def __len__(self) -> int:
        return self.end - self.first


def parse_home_set(text: str) -> HomeSet:
    """Read "val:0-20": 20 homes, 0 to 19. Raises ConfigError."""
    match = _RANGE.fullmatch(text)
    if match is None or match[1] not in SEEDS:
        raise ConfigError(
            f"homes are named SPLIT:FIRST-END, such as val:0-20, with a split of {_splits()}; not {text!r}"
        )
    homes = HomeSet(cast(Split, match[1]), int(match[2]), int(match[3]))
    if not homes.first < homes.end <= len(SEEDS[homes.split]):
        raise ConfigError(
            f"{text!r} names no homes: FIRST must be below END, and END at most {len(SEEDS[homes.split])}"
        )
    return homes


def make_home_set(homes: HomeSet, count: int, config: ObjectNavConfig) -> tuple[list[Scene], list[Episode]]:
    """The homes, and `count` episodes in them: alike many in each, and in all alike many of each category.

    The same arguments give the same homes and episodes. Raises ConfigError, EpisodeError.
    """
    if count < len(homes):
        raise ConfigError(f"{count} episodes are too few for {len(homes)} homes; give at least one each")
    renderer = make_renderer()
    scenes: list[Scene] = []
    episodes: list[Episode] = []
    for number in range(len(homes)):
        scene = generate_home(home_seed(homes.split, homes.first + number))
        wanted = (number + 1) * count // len(homes) - len(episodes)
        # Categories come in turn in each home; over all homes they do if each goes on where the last one stopped.
        skipped = len(episodes) % len(GOAL_CATEGORIES)
        grid = make_grid(scene, renderer, config)
        made = make_episodes(scene, grid, skipped + wanted, seed=homes.first + number, config=config, renderer=renderer)
        scenes.append(scene)
        episodes += made[skipped:]
    return scenes, episodes


def _splits() -> str:
    return ", ".join(SEEDS)
