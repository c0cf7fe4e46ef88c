"""Steps a second of the ObjectNav vector env alone, and how much of a step is not drawing.

    python benchmarks/env_speed.py [--envs 16] [--steps 300] [--homes 4]

Agents walk at random (they stop once in a hundred actions, so that episodes have a natural length). Prints a JSON line
for each figure: the median over repeats.
"""

import argparse
import json
import statistics
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode, make_episodes
from thinknav_sim.homes import generate_home
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import Camera, Renderer, make_renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

SIZES = (64, 128)
MOVES = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT, Action.STOP)
SHARES = (0.5, 0.245, 0.245, 0.01)


class TimedRenderer:
    """A renderer that counts the seconds it takes to draw."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self.seconds = 0.0

    def render(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        start = time.perf_counter()
        drawn = self._renderer.render(scene_ids, poses, camera)
        self.seconds += time.perf_counter() - start
        return drawn

    def __getattr__(self, name: str) -> Any:
        return getattr(self._renderer, name)


def prepare(homes: int) -> tuple[list[Scene], list[Episode], float]:
    """Homes, episodes, and the seconds that it took to prepare a home, its making not counted."""
    renderer = make_renderer()
    scenes = [generate_home(seed) for seed in range(homes)]
    episodes: list[Episode] = []
    seconds = []
    for scene in scenes:
        start = time.perf_counter()
        episodes += make_episodes(scene, NavigationGrid.from_scene(scene, renderer), 50, 0, renderer=renderer)
        seconds.append(time.perf_counter() - start)
    return scenes, episodes, statistics.median(seconds)


def measure(env: ObjectNavVectorEnv, steps: int, seed: int) -> tuple[float, float]:
    """Steps a second, and the share of the time that was not drawing."""
    timed = TimedRenderer(env.world.renderer)
    env.world.renderer = timed
    actions = np.random.default_rng(seed).choice(MOVES, (steps, env.num_envs), p=SHARES)
    env.reset(seed=seed)
    timed.seconds = 0.0
    start = time.perf_counter()
    for row in actions:
        env.step(row)
    seconds = time.perf_counter() - start
    env.world.renderer = timed._renderer
    return steps * env.num_envs / seconds, 1.0 - timed.seconds / seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--homes", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=5)
    args = parser.parse_args()
    scenes, episodes, preparing = prepare(args.homes)
    figures = [{"figure": "prepare a home", "value": round(preparing, 4), "unit": "s"}]
    for size in SIZES:
        env = ObjectNavVectorEnv(scenes, episodes, args.envs, ObjectNavConfig(width=size, height=size))
        measure(env, 20, 0)
        speeds, shares = zip(*(measure(env, args.steps, seed) for seed in range(args.repeats)), strict=True)
        name = f"{args.envs} envs, {size}x{size} RGB-D"
        figures.append({"figure": name, "value": round(statistics.median(speeds)), "unit": "steps/s"})
        figures.append(
            {"figure": f"{name}, not drawing", "value": round(statistics.median(shares), 3), "unit": "share"}
        )
        env.close()
    for figure in figures:
        print(json.dumps(figure))  # noqa: T201


if __name__ == "__main__":
    main()
