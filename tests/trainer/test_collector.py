"""Collection against the envs it steps: nothing lost, nothing twice, and time-outs bootstrapped."""

import numpy as np
import pytest
import torch

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import NO_ACTION, Actor
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import PPOConfig, TrainConfig
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.thinking import ThinkingEnv

CONFIG = PPOConfig(num_steps=12, chunk_length=4, precision="float32")


def collector(env: ThinkingEnv, smoke: TrainConfig, config: PPOConfig = CONFIG) -> Collector:
    torch.manual_seed(0)
    shape = ObservationShape(smoke.env.height, smoke.env.width, num_actions=5, thought_size=512)
    return Collector(env, Actor(Policy(shape, smoke.policy), env.num_envs, "float32", seed=0), config)


def turn_left(request: object) -> str:
    return "turn left"


def test_a_rollout_holds_each_transition_once_in_order(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    made = collector(thinking_env(turn_left, max_steps=5), smoke)
    rollout = made.collect()
    assert len(rollout) == 24
    actions = rollout.actions.reshape(2, 12)
    previous = rollout.previous_actions.reshape(2, 12)
    begins = previous == NO_ACTION
    assert begins[:, 0].all()
    assert begins[:, 5].any() or (actions[:, :5] == Action.STOP).any()  # episodes last 5 steps unless stopped
    follows = ~begins[:, 1:]
    assert torch.equal(previous[:, 1:][follows], actions[:, :-1][follows])
    # A thought follows each think, but where an episode began anew.
    thought = rollout.observations["thought"].reshape(2, 12, 512).abs().sum(-1) > 0
    expected = begins.clone()
    expected[:, 1:] |= actions[:, :-1] == Action.THINK
    assert torch.equal(thought, expected)


def test_no_sequence_crosses_an_episode_and_each_has_its_state(
    thinking_env: MakeThinkingEnv, smoke: TrainConfig
) -> None:
    made = collector(thinking_env(turn_left, max_steps=5), smoke)
    rollout = made.collect()
    for column, (start, length) in enumerate(zip(rollout.sequence_starts, rollout.sequence_lengths, strict=True)):
        assert (rollout.previous_actions[start + 1 : start + length] != NO_ACTION).all()
        if rollout.previous_actions[start] == NO_ACTION:
            assert not rollout.sequence_hidden[:, :, column].any()
        else:
            assert rollout.sequence_hidden[:, :, column].any()
    assert rollout.sequence_lengths.sum() == len(rollout)


def test_the_second_rollout_goes_on_where_the_first_ended(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    whole = collector(thinking_env(turn_left), smoke, CONFIG.model_copy(update={"num_steps": 12})).collect()
    halves = collector(thinking_env(turn_left), smoke, CONFIG.model_copy(update={"num_steps": 6}))
    first, second = halves.collect(), halves.collect()
    joined = torch.cat([first.actions.reshape(2, 6), second.actions.reshape(2, 6)], dim=1)
    assert torch.equal(joined, whole.actions.reshape(2, 12))
    seen = torch.cat([first.observations["gps"].reshape(2, 6, 2), second.observations["gps"].reshape(2, 6, 2)], dim=1)
    assert torch.equal(seen, whole.observations["gps"].reshape(2, 12, 2))


def test_a_time_out_is_bootstrapped_and_a_stop_is_not(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    config = CONFIG.model_copy(update={"num_steps": 3, "tau": 0.0, "gamma": 0.5})
    made = collector(thinking_env(turn_left, max_steps=3), smoke, config)
    with torch.no_grad():
        made._actor._policy.critic.bias.fill_(8.0)
        made._actor._policy.critic.weight.zero_()
        made._actor._policy.actor.bias[Action.STOP] = -1e9
    rollout = made.collect()
    # With tau 0 the return of the last step is its reward + gamma x the value (8) of the final observation.
    assert rollout.returns.reshape(2, 3)[:, 2] == pytest.approx([4, 4], abs=1.0)
    with torch.no_grad():
        made._actor._policy.actor.bias[Action.STOP] = 1e9
    stopped = made.collect()
    assert stopped.returns.reshape(2, 3).numpy() == pytest.approx(np.full((2, 3), -1e-3), abs=1e-6)


def test_state_is_whole(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    one, other = (collector(thinking_env(turn_left), smoke) for _ in range(2))
    one.collect()
    other.load_state_dict(one.state_dict())
    a, b = one.collect(), other.collect()
    assert torch.equal(a.actions, b.actions)
    assert torch.equal(a.returns, b.returns)
    assert one.episodes_ended == other.episodes_ended
    assert list(one.recent) == list(other.recent)
