"""The agent that asks aside: it makes the moves of the one that thinks, and no think among them."""

import zlib

import numpy as np
import pytest

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_proto import PlannerFailed, SubgoalRequest
from thinknav_sim.task_config import Action
from thinknav_trainer.agents import AsideAgent, Demonstrator, ObedientAgent
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.thoughts import Thought

ENVS = 3


def by_the_frame(request: SubgoalRequest) -> str | PlannerFailed:
    """Another word for another picture and goal; sometimes none. Nobody is told to stop."""
    number = zlib.crc32(request.goal.encode() + request.frame.data) % 4
    if number == 3:
        return PlannerFailed("no idea")
    return ("turn left", "turn right", "move forward")[number]


def moves(env: ThinkingEnv, agent: Demonstrator, steps: int) -> list[list[int]]:
    """What each env does in its first steps but to think."""
    observations = env.reset()
    thoughts: list[Thought] = []
    taken = []
    for _ in range(steps):
        actions = agent.actions(observations, thoughts)
        agent.took(actions)
        step = env.step(actions)
        agent.ended(step.terminated | step.truncated)
        observations, thoughts = step.observations, step.thoughts
        taken.append(actions)
    return [[int(action) for action in column if action != Action.THINK] for column in np.stack(taken, axis=1)]


@pytest.mark.parametrize("frame_size", [32, 48])
def test_it_does_what_the_one_that_thinks_does(thinking_env: MakeThinkingEnv, frame_size: int) -> None:
    loud = thinking_env(by_the_frame, ENVS, max_steps=90, frame_size=frame_size, frame_encoding="raw", patience=1e9)
    quiet = thinking_env(None, ENVS, max_steps=90, frame_size=frame_size)
    planner = PlannerClient(MockTransport(by_the_frame))
    thinking = moves(loud, ObedientAgent(ENVS, loud.env.config), 80)
    aside = moves(quiet, AsideAgent(quiet.env, planner, quiet.config), 80)
    for told, silent in zip(thinking, aside, strict=True):
        assert len(silent) == 80
        assert 40 < len(told) < 80
        assert silent[: len(told)] == told


def test_a_new_episode_has_a_plan_of_its_own(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(None, 1, max_steps=90)
    asked: list[str] = []

    def turn(request: SubgoalRequest) -> str:
        asked.append(request.goal)
        return "turn left"

    agent = AsideAgent(env.env, PlannerClient(MockTransport(turn)), env.config)
    observations = env.reset()
    for asks in (1, 1, 1, 2):  # three turns to a reply
        assert agent.actions(observations, ()).tolist() == [Action.TURN_LEFT]
        assert len(asked) == asks
    agent.ended(np.array([True]))
    agent.actions(observations, ())
    goal = env.env.episodes[env.env.episode_indices[0]].object_category
    assert asked == [goal] * 3
