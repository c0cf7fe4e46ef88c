"""Agents to measure others by: they see nothing of what they look for, unless their name says that they are told."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.follower import ShortestPathFollower
from thinknav_sim.observations import Observations
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.agents.agent import Agent
from thinknav_trainer.free_heading import BLOCKED_M
from thinknav_trainer.thoughts import Thought

# How far the bump-walker may turn away, in turns of 10 degrees.
FEWEST_TURNS, MOST_TURNS = 3, 18


class RandomAgent:
    """Takes any of some actions, one as likely as another."""

    def __init__(self, num_envs: int, choices: Sequence[Action], seed: int = 0) -> None:
        self._num_envs = num_envs
        self._choices = np.array(choices, np.int64)
        self._rng = np.random.default_rng(seed)

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        return self._rng.choice(self._choices, self._num_envs)

    def ended(self, done: NDArray[np.bool_]) -> None:
        """Nothing is remembered."""


class BumpWalker:
    """Walks straight on until something blocks, turns by a random angle, and walks on. It never stops by itself."""

    def __init__(self, num_envs: int, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        self._turns = np.zeros(num_envs, np.int64)  # still to take, positive to the left
        self._places = np.full((num_envs, 2), np.inf, np.float32)  # gps before the last step; inf after anything else
        self._gps = self._places

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        self._gps = gps = observations["gps"]
        blocked = np.linalg.norm(gps - self._places, axis=1) < BLOCKED_M
        turns = self._rng.integers(FEWEST_TURNS, MOST_TURNS + 1, len(gps)) * self._rng.choice([-1, 1], len(gps))
        self._turns[blocked] = turns[blocked]
        turning = self._turns != 0
        turn = np.where(self._turns > 0, Action.TURN_LEFT, Action.TURN_RIGHT)
        self._turns -= np.sign(self._turns)
        self._places = np.where(turning[:, None], np.inf, gps).astype(np.float32)
        return np.where(turning, turn, Action.MOVE_FORWARD).astype(np.int64)

    def took(self, actions: NDArray[np.int64]) -> None:
        """See `Demonstrator.took`."""
        self._places = np.where((actions == Action.MOVE_FORWARD)[:, None], self._gps, np.inf).astype(np.float32)

    def ended(self, done: NDArray[np.bool_]) -> None:
        self._turns[done] = 0
        self._places[done] = np.inf


class ShortestPathAgent:
    """Privileged: walks the shortest way, turns to the goal, and stops."""

    def __init__(self, env: ObjectNavVectorEnv) -> None:
        self._follower = ShortestPathFollower(env)

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        return self._follower.actions()

    def ended(self, done: NDArray[np.bool_]) -> None:
        """Nothing is remembered."""


class PerfectStop:
    """Privileged: another agent, told when it would succeed by stopping."""

    def __init__(self, agent: Agent, env: ObjectNavVectorEnv) -> None:
        self._agent = agent
        self._env = env

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:
        return np.where(self._env.would_succeed(), Action.STOP, self._agent.actions(observations, thoughts))

    def ended(self, done: NDArray[np.bool_]) -> None:
        self._agent.ended(done)
