"""Agents that walk at random through homes, and how long their steps take."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render import Camera, Renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import Action, ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.bench.figures import Timing, timed
from thinknav_trainer.bench.worlds import episodes_in

# They stop once in a hundred actions, so that episodes have a natural length.
_MOVES = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT, Action.STOP)
_SHARES = (0.5, 0.245, 0.245, 0.01)


class RandomWalkers:
    """A vector env and the random actions of its agents."""

    def __init__(self, homes: list[Scene], agents: int, size: int) -> None:
        self.agents = agents
        self.env = ObjectNavVectorEnv(homes, episodes_in(homes), agents, ObjectNavConfig(width=size, height=size))
        self.env.reset(seed=0)
        self._draw = np.random.default_rng(0)

    def walk(self, steps: int, batch: int | None = None) -> None:
        """Take that many steps with every agent: all at once, or so many in one call."""
        groups = np.split(np.arange(self.agents), range(batch or self.agents, self.agents, batch or self.agents))
        for actions in self._draw.choice(_MOVES, (steps, self.agents), p=_SHARES):
            for group in groups:
                self.env.step_subset(group, actions[group])

    def time_frames(self, frames: int, batch: int | None = None) -> Timing:
        """The time of a frame, over at least that many."""
        steps = -(-frames // self.agents)
        taken = timed(lambda: self.walk(steps, batch))()
        return Timing(taken.wall / (steps * self.agents), taken.cpu / (steps * self.agents))

    def other_share(self, steps: int) -> float:
        """The share of the processor's time for these steps that was not drawing."""
        with timed_renderer(self.env) as renderer:
            taken = timed(lambda: self.walk(steps))()
        return 1 - renderer.cpu / taken.cpu

    def close(self) -> None:
        self.env.close()


class _TimedRenderer:
    """A renderer that counts what drawing takes: the process's seconds of the processor (cpu), and those of the clock.

    Where other threads work meanwhile, the first are theirs as well.
    """

    def __init__(self, renderer: Renderer) -> None:
        self.renderer = renderer
        self.cpu = self.wall = 0.0

    def render(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        pictures: list[tuple[NDArray[np.uint8], NDArray[np.float32]]] = []
        taken = timed(lambda: pictures.append(self.renderer.render(scene_ids, poses, camera)))()
        self.cpu, self.wall = self.cpu + taken.cpu, self.wall + taken.wall
        return pictures[0]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.renderer, name)


@contextmanager
def timed_renderer(env: ObjectNavVectorEnv) -> Iterator[_TimedRenderer]:
    timing = _TimedRenderer(env.world.renderer)
    env.world.renderer = cast(Renderer, timing)
    try:
        yield timing
    finally:
        env.world.renderer = timing.renderer
