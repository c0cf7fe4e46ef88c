"""Pictures for the planner: drawn where nobody has seen them yet, and not otherwise."""

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.planner_frames import PlannerFrames


class Drawing:
    """An env of four agents that draws their numbers, and counts."""

    num_envs = 4
    drawn = 0

    def frames(self, agents: NDArray[np.integer[Any]], width: int, height: int) -> NDArray[np.uint8]:
        self.drawn += len(agents)
        return numbered(agents, width, height)


def numbered(agents: Any, width: int, height: int, add: int = 0) -> NDArray[np.uint8]:
    return np.stack([np.full((height, width, 3), agent + add, np.uint8) for agent in agents])


def made(size: int) -> tuple[Drawing, PlannerFrames]:
    env = Drawing()
    return env, PlannerFrames(cast(ObjectNavVectorEnv, env), size)


def test_what_agents_see_in_the_planners_size_is_not_drawn_again() -> None:
    env, frames = made(16)
    frames.observe(np.arange(4), numbered(range(4), 16, 16))
    frames.observe(np.array([2]), numbered([2], 16, 16, add=10))
    assert frames.of(np.array([3, 2, 0]))[:, 0, 0, 0].tolist() == [3, 12, 0]
    assert env.drawn == 0


def test_other_sizes_are_drawn() -> None:
    env, frames = made(16)
    frames.observe(np.arange(4), numbered(range(4), 32, 32))
    assert frames.of(np.array([1, 2])).shape == (2, 16, 16, 3)
    assert env.drawn == 2


def test_agents_who_are_elsewhere_are_drawn_until_they_see_something() -> None:
    env, frames = made(16)
    frames.observe(np.arange(4), numbered(range(4), 16, 16, add=10))
    frames.forget()
    assert frames.of(np.array([1]))[0, 0, 0, 0] == 1
    frames.observe(np.array([1]), numbered([1], 16, 16, add=20))
    assert frames.of(np.array([1]))[0, 0, 0, 0] == 21
    assert env.drawn == 1
