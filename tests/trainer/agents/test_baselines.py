"""Agents to measure others by."""

import numpy as np

from thinknav_sim.task_config import Action
from thinknav_trainer.agents import BumpWalker, RandomAgent

STOP, FORWARD, LEFT, RIGHT, _ = Action


def test_the_random_agent_takes_all_its_choices_alike() -> None:
    agent = RandomAgent(1000, (FORWARD, LEFT), seed=1)
    actions = agent.actions({}, [])
    assert set(actions) == {FORWARD, LEFT}
    assert 400 < (actions == LEFT).sum() < 600


def test_the_bump_walker_turns_only_where_it_is_blocked() -> None:
    agent = BumpWalker(2, seed=0)
    gps = np.zeros((2, 2), np.float32)
    assert agent.actions({"gps": gps}, []).tolist() == [FORWARD, FORWARD]
    gps[0] += 0.25
    turned = []
    for _ in range(3):
        actions = agent.actions({"gps": gps}, [])
        assert actions[0] == FORWARD
        gps[0] += 0.25
        turned.append(Action(actions[1]))
    assert len(set(turned)) == 1
    assert turned[0] in (LEFT, RIGHT)
    while actions[1] != FORWARD:  # and walks on by itself, from where it is
        actions = agent.actions({"gps": gps}, [])
        gps[0] += 0.25


def test_a_new_episode_is_no_bump() -> None:
    agent = BumpWalker(1)
    gps = np.zeros((1, 2), np.float32)
    agent.actions({"gps": gps}, [])
    agent.ended(np.array([True]))
    assert agent.actions({"gps": gps}, []).tolist() == [FORWARD]
