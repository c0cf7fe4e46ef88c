"""Plans: one instruction at a time, until it is carried out; and strategy `once`, which asks for them."""

import numpy as np
import pytest

from tests.trainer.conftest import MakeThinkingEnv
from tests.trainer.test_thinking import act, descriptions, embed
from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import PlannerFailed, SubgoalReply, SubgoalRequest
from thinknav_sim.task_config import Action
from thinknav_trainer.planner import MockTransport, reply_to
from thinknav_trainer.plans import Plans

STOP, FORWARD, LEFT, RIGHT, THINK = Action
PLAN = ("turn left to the door", "look around", "move forward", "stop at the chair")


def planner(request: SubgoalRequest) -> SubgoalReply:
    assert request.mode == "plan"
    return reply_to(request, PLAN[0]).model_copy(update={"instructions": PLAN})


def test_an_instruction_stays_until_it_is_done() -> None:
    plans = Plans(2)
    assert plans.current(0) is None
    assert not plans.follow(0, LEFT)
    plans.begin(0, PLAN, shipped_text_encoder().encode(PLAN))
    seen, news = [], []
    for action in (RIGHT, THINK, LEFT, RIGHT, LEFT, FORWARD, STOP):
        instruction = plans.current(0)
        seen.append(None if instruction is None else PLAN.index(instruction.text))
        news.append(plans.follow(0, action))
    assert seen == [0, 0, 0, 1, 2, 2, 3]
    assert news == [False, False, True, True, False, True, True]
    assert plans.current(0) is None
    assert plans.current(1) is None


def test_once_shows_the_plan_step_by_step(thinking_env: MakeThinkingEnv) -> None:
    env = thinking_env(planner, strategy="once", reward="paper")
    observations = env.reset()
    np.testing.assert_allclose(observations["thought"], descriptions(observations))
    assert observations["forced_think"].tolist() == [1, 1]
    step = env.step(act(THINK, THINK))
    shown, paid = [step.observations["thought"]], []
    assert not step.observations["forced_think"].any()
    for actions in (act(RIGHT, LEFT), act(LEFT, LEFT), act(FORWARD, FORWARD), act(FORWARD, FORWARD), act(LEFT, LEFT)):
        before = env._term_sums["agreement"].copy()
        shown.append(env.step(actions).observations["thought"])
        paid.append(np.round(env._term_sums["agreement"] - before, 3).tolist())
    for agent, instructions in enumerate(([0, 0, 1, 2, 3, 3], [0, 1, 2, 3, 3, 3])):
        for thoughts, index in zip(shown, instructions, strict=True):
            np.testing.assert_allclose(thoughts[agent], embed(PLAN[index]), atol=1e-6)
    # Each instruction is judged by the first action that meets it, and by no other.
    assert paid == [[-0.1, 0.1], [0, 0], [0, 0.1], [0.1, -0.1], [-0.1, 0]]


def test_a_plan_ends_with_its_episode_and_is_part_of_the_state(thinking_env: MakeThinkingEnv) -> None:
    env, other = (thinking_env(planner, strategy="once") for _ in range(2))
    env.reset()
    other.reset()
    env.step(act(THINK, THINK))
    other.load_state_dict(env.state_dict())
    for one in (env, other):
        step = one.step(act(STOP, LEFT))
        np.testing.assert_allclose(step.observations["thought"][0], descriptions(step.observations)[0])
        np.testing.assert_allclose(step.observations["thought"][1], embed(PLAN[1]), atol=1e-6)
        assert step.observations["forced_think"].tolist() == [1, 0]
        assert not one.step(act(LEFT, LEFT)).observations["thought"][0].any()


@pytest.mark.parametrize("broken", ["planner", "text encoder"])
def test_a_plan_that_failed_is_no_plan(
    thinking_env: MakeThinkingEnv, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    def fail(*_: object) -> None:
        raise PlannerFailed("no idea")

    env = thinking_env(fail if broken == "planner" else planner, strategy="once", reward="paper")
    env.reset()
    monkeypatch.setattr(MockTransport, "embed", fail)
    step = env.step(act(THINK, THINK))
    assert not step.observations["thought"].any()
    assert [thought.error for thought in step.thoughts] == ["PlannerFailed: no idea"] * 2
    assert (env.counts.answered, env.counts.failed) == (0, 2)
    env.step(act(LEFT, LEFT))
    assert not env._term_sums["agreement"].any()
