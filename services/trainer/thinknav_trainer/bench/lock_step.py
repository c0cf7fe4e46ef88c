"""The trainer's env and the eyes of its policy, for learners of other libraries: all move together, or wait together.

Runs in a peer's process. What it observes besides is the previous action, which our policy remembers by itself.
"""

import json
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, redirect_stdout
from dataclasses import dataclass, replace
from typing import TextIO

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from torch import Tensor, nn

from thinknav_sim.observations import Observations, observation_space
from thinknav_sim.render import set_render_threads
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.config import TrainConfig, parse_config
from thinknav_trainer.planner import PlannerClient, connect
from thinknav_trainer.policy import Policy
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.thinking import Step, ThinkingEnv
from thinknav_trainer.train import observation_shape

PREVIOUS_ACTION = "previous_action"  # (N, 1) int64, 1 and up; 0 where an episode begins


class LockStepEnv:
    """N agents in the homes of a configuration, whose thinks are answered before anyone moves on.

    boxes: the spaces of one agent's observation. thought_size: length of a thought, 0 without a planner.
    """

    def __init__(self, config: TrainConfig, planner: PlannerClient | None) -> None:
        homes = make_homes(config)
        vector_env = ObjectNavVectorEnv(homes.scenes, homes.train, config.num_envs, config.task, seed=config.seed)
        self._env = ThinkingEnv(vector_env, config.think, planner, discount=config.ppo.gamma)
        self._env.share = 0.0
        self.num_envs = config.num_envs
        self.num_actions = config.task.num_actions
        self.thought_size = 0 if planner is None else planner.info.embedding_dimension
        spaces = observation_space(config.task).spaces
        self.boxes = {name: space for name, space in spaces.items() if isinstance(space, Box)}
        if self.thought_size:
            self.boxes["thought"] = Box(-1.0, 1.0, (self.thought_size,), np.float32)
        self.boxes[PREVIOUS_ACTION] = Box(0, self.num_actions, (1,), np.int64)

    def reset(self) -> Observations:
        return self._with_actions(self._env.reset(), np.zeros(self.num_envs, np.int64))

    def step(self, actions: NDArray[np.int64]) -> Step:
        """Take the actions (N,)."""
        step = self._env.step(actions)
        for row, observation in step.final_observations.items():
            observation[PREVIOUS_ACTION] = actions[row : row + 1] + 1
        self._with_actions(step.observations, np.where(step.terminated | step.truncated, 0, actions + 1))
        return step

    def _with_actions(self, observations: Observations, previous: NDArray[np.int64]) -> Observations:
        observations[PREVIOUS_ACTION] = previous[:, None]
        return observations


class Senses(nn.Module):
    """All of our policy that comes before its LSTM: what that is fed of each transition, (B, size)."""

    def __init__(self, config: TrainConfig, thought_size: int) -> None:
        """thought_size: length of a thought, 0 without a planner."""
        super().__init__()
        self.shape = replace(observation_shape(config, None), thought_size=thought_size)
        self._policy = Policy(self.shape, config.network)
        self.size = self._policy.rnn.input_size
        # The other library has its own of these.
        del self._policy.rnn, self._policy.actor, self._policy.critic

    def forward(self, observations: Mapping[str, Tensor]) -> Tensor:
        """Of observations (B, ...) in any number format, pictures flat or not."""
        height, width = self.shape.height, self.shape.width
        seen = dict(observations) | {
            "rgb": observations["rgb"].reshape(-1, height, width, 3),
            "depth": observations["depth"].reshape(-1, height, width, 1),
            "objectgoal": observations["objectgoal"].long(),
        }
        vision = self._policy.vision
        return self._policy.features(vision.prepare(vision.look(seen)), seen[PREVIOUS_ACTION].long().reshape(-1) - 1)


def set_priors(actor: nn.Linear, config: TrainConfig) -> None:
    """The priors on stop and think: without them an episode lasts a few steps, and the time goes into new ones."""
    with torch.no_grad():
        actor.bias[Action.STOP] = config.network.stop_bias
        if actor.out_features > Action.THINK:
            actor.bias[Action.THINK] = config.network.think_bias


@dataclass(frozen=True)
class Orders:
    """What a peer that trains was told. updates: one for each time that it is to collect and learn, as they come."""

    config: TrainConfig
    planner: PlannerClient | None
    updates: Iterator[None]


@contextmanager
def orders() -> Iterator[Orders]:
    """Be a peer that trains. argv: a configuration as JSON, and the URL of a planning service where it thinks.

    The first update asked for says that the learner is made. Each line of stdin is a number of updates; after them the
    answer has the steps and the seconds that they took. Nothing else gets to stdout.
    """
    config = parse_config(json.loads(sys.argv[1]))
    if config.threads:
        torch.set_num_threads(config.threads)
        set_render_threads(config.threads)
    answers = sys.stdout
    with redirect_stdout(sys.stderr), connect(sys.argv[2]) if sys.argv[2:] else nullcontext() as planner:
        yield Orders(config, planner, _updates(config.steps_per_update, answers))


def _updates(steps: int, answers: TextIO) -> Iterator[None]:
    answers.write("ready\n")
    answers.flush()
    for line in sys.stdin:
        start, count = time.perf_counter(), int(line)
        for _ in range(count):
            yield
        answers.write(json.dumps({"steps": count * steps, "seconds": time.perf_counter() - start}) + "\n")
        answers.flush()
