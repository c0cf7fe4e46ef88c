"""The five rules of thinking, one group of tests for each, on the real simulator."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import PlannerFailed, SubgoalRequest, Unavailable
from thinknav_sim.observations import Observations
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_trainer.thinking import ThinkingEnv, task_description

STOP, FORWARD, LEFT, RIGHT, THINK = Action


def embed(text: str) -> NDArray[np.float32]:
    vector: NDArray[np.float32] = shipped_text_encoder().encode([text])[0]
    return vector


def act(*actions: Action) -> NDArray[np.int64]:
    return np.array(actions, np.int64)


def descriptions(observations: Observations) -> NDArray[np.float32]:
    goals = [GOAL_CATEGORIES[goal] for goal in observations["objectgoal"][:, 0]]
    return np.stack([embed(task_description(goal)) for goal in goals])


def say(text: str):  # type: ignore[no-untyped-def]
    return lambda request: text


# 1. At reset the thought is the text embedding of the task description.


def test_the_first_thought_is_the_task(thinking_env: MakeThinkingEnv) -> None:
    assert task_description("tv_monitor") == "find a tv monitor"
    observations = thinking_env(say("turn left")).reset()
    np.testing.assert_allclose(observations["thought"], descriptions(observations))


def test_the_next_episode_begins_with_its_own_task(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(say("turn left"))
    env.reset()
    step = env.step(act(STOP, LEFT))
    assert step.terminated.tolist() == [True, False]
    np.testing.assert_allclose(step.observations["thought"][0], descriptions(step.observations)[0])
    assert not step.observations["thought"][1].any()


# 2. think leaves the pose, counts as a step, is charged, shows frame t; observation t+1 carries the reply.


def test_thinking_stands_still_counts_and_costs(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(say("turn left"), reward="think_cost", cost=0.03)
    env.reset()
    before = env.env.poses
    step = env.step(act(THINK, LEFT))
    np.testing.assert_array_equal(env.env.poses[0], before[0])
    assert env.env.poses[1, 3] != before[1, 3]
    slack = env.env.config.slack_reward
    assert step.rewards == pytest.approx([slack - 0.03, slack], abs=1e-6)
    np.testing.assert_allclose(step.observations["thought"][0], embed("turn left"))
    ended = env.step(act(STOP, STOP)).ended
    assert [end.measures["steps"] for end in ended] == [2, 2]
    assert [end.measures["thinks"] for end in ended] == [1, 0]
    assert [end.terms["think_cost"] for end in ended] == pytest.approx([-0.03, 0])


def test_the_planner_sees_the_frame_of_the_observation_and_the_goal(thinking_env: MakeThinkingEnv) -> None:
    asked: list[SubgoalRequest] = []

    def note(request: SubgoalRequest) -> str:
        asked.append(request)
        return "turn left"

    env = thinking_env(note, frame_encoding="raw", frame_size=32)
    env.reset()
    observations = env.step(act(LEFT, FORWARD)).observations
    env.step(act(THINK, THINK))
    for row, request in enumerate(asked):
        frame = np.frombuffer(request.frame.data, np.uint8).reshape(32, 32, 3)
        np.testing.assert_array_equal(frame, observations["rgb"][row])  # the smoke preset draws 32 x 32
        assert request.goal == GOAL_CATEGORIES[observations["objectgoal"][row, 0]]
    assert len({request.request_id for request in asked}) == 2


# 3. Every other observation carries zeros, and no thought outlives its episode.


def test_a_thought_lasts_one_step(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(say("turn left"))
    env.reset()
    env.step(act(THINK, THINK))
    assert not env.step(act(LEFT, RIGHT)).observations["thought"].any()


def test_a_thought_of_the_last_step_stays_in_its_episode(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(say("turn left"), max_steps=3, reward="paper")
    env.reset()
    env.step(act(LEFT, LEFT))
    env.step(act(LEFT, LEFT))
    step = env.step(act(THINK, LEFT))
    assert step.truncated.all()
    np.testing.assert_allclose(step.final_observations[0]["thought"], embed("turn left"))
    assert not step.final_observations[1]["thought"].any()
    np.testing.assert_allclose(step.observations["thought"], descriptions(step.observations))
    # Nor is the new episode's first action judged by it.
    following = env.step(act(LEFT, LEFT))
    assert following.rewards[0] == pytest.approx(env.env.config.slack_reward)


# 4. The first action after a reply that is not think is judged.


def agreements(env: ThinkingEnv, *actions: Action) -> list[float]:
    """What agreement paid agent 0 for each action; 0.1 a piece, whatever progress paid."""
    paid = []
    for action in actions:
        before = env._term_sums.get("agreement", np.zeros(env.num_envs))[0]
        env.step(act(action, LEFT))
        paid.append(round(float(env._term_sums["agreement"][0] - before), 6))
    return paid


@pytest.mark.parametrize(
    ("subgoal", "action", "paid"),
    [
        ("turn left to the door", LEFT, 0.1),
        ("turn left to the door", RIGHT, -0.1),
        ("turn right", RIGHT, 0.1),
        ("move forward", FORWARD, 0.1),
        ("move forward", LEFT, -0.1),
        ("look around", LEFT, 0.0),
    ],
)
def test_the_next_action_is_judged(thinking_env: MakeThinkingEnv, subgoal: str, action: Action, paid: float) -> None:
    env = thinking_env(say(subgoal), reward="paper")
    env.reset()
    assert agreements(env, THINK, action, action) == [0, paid, 0]  # once


def test_stopping_is_judged_too(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(lambda r: "stop, it is right ahead" if r.request_id == "1" else "turn left", reward="paper")
    env.reset()
    env.step(act(THINK, THINK))
    ended = env.step(act(STOP, STOP)).ended
    assert [end.terms["agreement"] for end in ended] == pytest.approx([0.1, -0.1])


def test_a_second_think_replaces_the_first_unjudged(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(lambda r: {"1": "turn left", "2": "turn right"}[r.request_id], reward="paper")
    env.reset()
    assert agreements(env, THINK, THINK, RIGHT) == [0, 0, 0.1]


def test_a_second_think_without_direction_leaves_nothing_to_judge(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(lambda r: {"1": "turn left", "2": "look around"}[r.request_id], reward="paper")
    env.reset()
    assert agreements(env, THINK, THINK, RIGHT) == [0, 0, 0]


# 5. A planner that fails gives zeros, judges nothing, and is counted; gone too long, it ends the run.


def test_a_failure_is_no_thought(thinking_env: MakeThinkingEnv) -> None:
    def sometimes(request: SubgoalRequest) -> str:
        if request.request_id == "1":
            raise PlannerFailed("no idea")
        return "turn left"

    env = thinking_env(sometimes, reward="paper")
    env.reset()
    step = env.step(act(THINK, THINK))
    assert not step.observations["thought"][0].any()
    np.testing.assert_allclose(step.observations["thought"][1], embed("turn left"))
    assert [thought.subgoal for thought in step.thoughts] == [None, "turn left"]
    assert step.thoughts[0].error == "PlannerFailed: no idea"
    assert (env.counts.asked, env.counts.answered, env.counts.failed) == (2, 1, 1)
    assert agreements(env, RIGHT) == [0]


def test_a_planner_that_is_gone_too_long_ends_the_run(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(lambda request: Unavailable("connection refused"), patience=0.0)
    env.reset()
    env.step(act(LEFT, RIGHT))
    with pytest.raises(Unavailable, match=r"has not answered for .* \(think.patience is 0 s\): connection refused"):
        env.step(act(THINK, LEFT))


def test_a_withheld_reply_is_no_thought_but_costs(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(say("turn left"), reward="paper", dropout=0.5, count=8, max_steps=100)
    env.reset()
    seen: list[bool] = []
    for _ in range(10):
        step = env.step(np.full(8, Action.THINK))
        assert [thought.subgoal for thought in step.thoughts] == ["turn left"] * 8
        assert step.rewards == pytest.approx(np.full(8, -0.011))
        told = np.asarray(step.observations["thought"].any(axis=1))
        before = env._term_sums["agreement"].copy()
        env.step(np.full(8, Action.TURN_RIGHT))
        assert env._term_sums["agreement"] - before == pytest.approx(np.where(told, -0.1, 0))  # nothing to judge
        seen.extend(told.tolist())
    assert 0.3 < np.mean(seen) < 0.7
    assert (env.counts.asked, env.counts.answered, env.counts.failed) == (80, 80, 0)
    assert env.counts.withheld == 80 - sum(seen)


def test_which_replies_are_withheld_goes_on_from_a_state(thinking_env: MakeThinkingEnv) -> None:
    one, other = (thinking_env(say("turn left"), dropout=0.5, max_steps=100) for _ in range(2))
    one.reset()
    other.reset()
    for _ in range(5):
        one.step(act(THINK, THINK))
    other.load_state_dict(one.state_dict())
    for _ in range(20):
        a, b = (env.step(act(THINK, THINK)).observations["thought"].any(axis=1).tolist() for env in (one, other))
        assert a == b


# Strategies and state


def test_without_a_planner_there_is_no_thought_and_no_think_action(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(None)
    assert "thought" not in env.reset()
    assert "thought" not in env.step(act(LEFT, STOP)).observations
    assert env.env.config.num_actions == 4


def test_a_strategy_and_its_planner_must_fit(thinking_env: MakeThinkingEnv) -> None:
    with pytest.raises(ValueError, match="strategy 'never' takes no planner"):
        thinking_env(say("turn left"), strategy="never")


def test_episode_ends_sum_their_terms(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(say("turn left"), max_steps=7, reward="paper")
    env.reset()
    rng = np.random.default_rng(0)
    total = np.zeros(2)
    for _ in range(7):
        step = env.step(rng.integers(1, 5, 2))
        total += step.rewards
    assert [sum(end.terms.values()) for end in step.ended] == pytest.approx(total, abs=1e-5)
    assert set(step.ended[0].terms) == {"slack", "progress", "success", "think_cost", "agreement"}


def test_the_next_episode_counts_from_nothing(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(say("turn left"))
    env.reset()
    env.step(act(THINK, LEFT))
    env.step(act(STOP, LEFT))
    (second,) = env.step(act(STOP, LEFT)).ended
    assert second.terms["think_cost"] == 0
    assert second.terms["slack"] == pytest.approx(-1e-3)


def test_state_is_whole(thinking_env: MakeThinkingEnv) -> None:
    one, other = thinking_env(say("turn right"), reward="paper"), thinking_env(say("turn right"), reward="paper")
    one.reset()
    other.reset()
    one.step(act(THINK, LEFT))
    other.load_state_dict(one.state_dict())
    for actions in (act(RIGHT, THINK), act(THINK, RIGHT), act(STOP, RIGHT)):
        a, b = one.step(actions), other.step(actions)
        np.testing.assert_array_equal(a.rewards, b.rewards)
        assert a.ended == b.ended
        for name, values in a.observations.items():
            np.testing.assert_array_equal(values, b.observations[name])
    assert one.counts == other.counts
