"""Controls: nobody hears what was said to it, and what is heard instead is what the control says."""

import json
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import PlannerFailed, SubgoalReply, SubgoalRequest
from thinknav_sim.task_config import Action
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import ConfigError, ControlName, TrainConfig, change_config
from thinknav_trainer.control import ALWAYS, CONTROLS, DIRECTIONS, NOTHING, UNASKED, Control
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.evaluate_agent import Setting, evaluate_agent
from thinknav_trainer.home_sets import parse_home_set
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import Answer, MockTransport, PlannerClient, encode_frame, reply_to
from thinknav_trainer.planner.embedded import EmbeddedPlanner
from thinknav_trainer.planner.privileged import PrivilegedPlanner
from thinknav_trainer.scenes import Homes
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.workflow import evaluate_checkpoint, train_run

FRAME = encode_frame(np.zeros((16, 16, 3), np.uint8), "raw")
EMBED = shipped_text_encoder().encode


def made(name: ControlName, seed: int = 0) -> Control:
    return Control(name, EMBED, lambda env: "chair", seed)


def reply(env: int, number: int, plan: bool = False) -> SubgoalReply:
    """What was said to an env: its words name it."""
    mode: Literal["plan", "subgoal"] = "plan" if plan else "subgoal"
    request = SubgoalRequest(request_id=str(number), goal="chair", frame=FRAME, mode=mode)
    return reply_to(request, f"turn left to env {env} in {number}")


def said(answers: dict[int, Answer]) -> dict[int, str]:
    return {env: answer.subgoal for env, answer in answers.items() if isinstance(answer, SubgoalReply)}


def test_zeros_say_nothing_and_judge_nothing() -> None:
    told = made("zeros").replace({0: reply(0, 1), 2: reply(2, 2, plan=True), 3: PlannerFailed("no")})
    assert said(told) == {0: NOTHING, 2: NOTHING}
    assert subgoal_direction(NOTHING) is None
    for env in (0, 2):
        answer = told[env]
        assert isinstance(answer, SubgoalReply)
        assert not answer.embedding.any()
        assert answer.instructions == ()
    assert isinstance(told[3], PlannerFailed)


def test_another_is_never_ones_own() -> None:
    control = made("another")
    number = 0
    for envs in ([2], [2], [5], [5], [2, 5], [1], *[list(range(8))] * 5, [3], [3]):
        answers: dict[int, Answer] = {}
        for env in envs:
            number += 1
            answers[env] = reply(env, number)
        told = said(control.replace(answers))
        if len(envs) > 1:
            assert sorted(told.values()) == sorted(said(answers).values())
        for env, words in told.items():
            assert f"env {env} " not in words
        if number <= 2:
            assert told == {2: NOTHING}
        elif number == 3:
            assert told == {5: "turn left to env 2 in 2"}


def test_another_gets_the_words_the_embedding_and_the_plan() -> None:
    told = made("another").replace({0: reply(0, 1, plan=True), 1: reply(1, 2, plan=True)})
    answer = told[0]
    assert isinstance(answer, SubgoalReply)
    assert (answer.request_id, answer.instructions) == ("1", ("turn left to env 1 in 2",))
    assert answer.embedding == pytest.approx(EMBED(["turn left to env 1 in 2"])[0], abs=1e-6)


def test_constant_and_random() -> None:
    told = made("constant").replace({0: reply(0, 1), 1: reply(1, 2, plan=True)})
    assert said(told) == {0: "move forward", 1: "move forward"}
    plan = told[1]
    assert isinstance(plan, SubgoalReply)
    assert plan.instructions == ("move forward",)
    assert plan.embedding == pytest.approx(EMBED(["move forward"])[0], abs=1e-6)
    drawn = [said(made("random").replace({0: reply(0, number)}))[0] for number in range(80)]
    directions = [subgoal_direction(words) for words in drawn]
    assert all(directions.count(action) > 8 for action in DIRECTIONS)
    assert drawn == [said(made("random").replace({0: reply(0, number)}))[0] for number in range(80)]
    assert drawn != [said(made("random", seed=1).replace({0: reply(0, number)}))[0] for number in range(80)]


def test_none_changes_nothing_and_what_is_remembered_is_kept() -> None:
    own: dict[int, Answer] = {0: reply(0, 1)}
    assert made("none").replace(own) == own
    control, later = made("another"), made("another")
    control.replace({4: reply(4, 1)})
    later.load_state_dict(control.state_dict())
    assert said(later.replace({0: reply(0, 2)})) == {0: "turn left to env 4 in 1"}
    drawing, on = made("random", seed=7), made("random", seed=8)
    on.load_state_dict(drawing.state_dict())
    replies: list[dict[int, Answer]] = [{0: reply(0, number)} for number in range(20)]
    assert [said(on.replace(one)) for one in replies] == [said(drawing.replace(one)) for one in replies]


def test_the_policy_sees_what_the_control_tells(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    base = thinking_env(lambda request: "turn right", count=3, reward="paper")
    think = np.full(3, Action.THINK)
    judged = {}
    for name in CONTROLS:
        planner = PlannerClient(MockTransport(lambda request: "turn right"))
        env = ThinkingEnv(base.env, base.config, planner, control=name)
        env.reset()
        step = env.step(think)
        assert planner.counts.asked == (0 if name in UNASKED else 3)  # what nobody hears is not asked
        seen = step.observations["thought"]
        assert seen.any() == (name not in ("zeros", "deaf"))
        judged[name] = env.step(np.full(3, Action.TURN_RIGHT)).rewards - smoke.env.slack_reward
    assert judged["none"] == pytest.approx(0.1, abs=1e-6)
    assert judged["another"] == pytest.approx(0.1, abs=1e-6)
    assert judged["zeros"] == pytest.approx(0, abs=1e-6)
    assert judged["deaf"] == pytest.approx(0, abs=1e-6)
    assert judged["constant"] == pytest.approx(-0.1, abs=1e-6)


@pytest.mark.parametrize("strategy", ["agent", "once"])
def test_the_deaf_are_told_all_and_hear_nothing(thinking_env: MakeThinkingEnv, strategy: str) -> None:
    base = thinking_env(lambda request: "turn right", count=2)
    config = base.config.model_copy(update={"strategy": strategy})
    env = ThinkingEnv(base.env, config, PlannerClient(MockTransport(lambda request: "turn right")), control="deaf")
    assert env.reset()["thought"].any()  # the task is no reply
    step = env.step(np.full(2, Action.THINK))
    assert [thought.subgoal for thought in step.thoughts] == ["turn right"] * 2
    assert not step.observations["thought"].any()
    assert env.counts.withheld == env.counts.answered == 2
    assert not env.step(np.full(2, Action.TURN_RIGHT)).observations["thought"].any()


def test_the_deaf_replay_as_deaf(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    """Their recording has what was said."""
    config = change_config(smoke, overrides=["planner=embedded", "planner.control=deaf", "total_steps=64"])
    first, again = (
        Checkpoint.load(train_run(tmp_path / name, config, Interruption(), homes=homes, replay=replay))
        for name, replay in (("first", None), ("again", tmp_path / "first"))
    )
    assert all(torch.equal(weights, again.policy[name]) for name, weights in first.policy.items())


def test_a_plan_that_nobody_hears_has_one_step(thinking_env: MakeThinkingEnv) -> None:
    base = thinking_env(lambda request: "turn right", count=2)
    config = base.config.model_copy(update={"strategy": "once"})
    told: dict[ControlName, str] = {"constant": ALWAYS, "zeros": NOTHING}
    for name, words in told.items():
        env = ThinkingEnv(base.env, config, PlannerClient(MockTransport(lambda request: "turn right")), control=name)
        env.reset()
        step = env.step(np.full(2, Action.THINK))
        assert [thought.subgoal for thought in step.thoughts] == [words] * 2
        assert step.observations["thought"].any() == (name == "constant")
        env.step(np.full(2, Action.MOVE_FORWARD))
        assert not env.step(np.full(2, Action.TURN_LEFT)).observations["thought"].any()


def test_trained_and_tested_with_controls(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = change_config(smoke, overrides=["planner=embedded", "planner.control=another", "total_steps=64"])
    last = train_run(tmp_path / "run", config, Interruption(), homes=homes)
    usual, _ = evaluate_checkpoint(last, "held_out", Interruption(), homes=homes)
    masked, records = evaluate_checkpoint(last, "held_out", Interruption(), homes=homes, control="zeros")
    assert (usual.parent.name, masked.parent.parent.name, masked.name) == ("evaluations", "controls", "zeros")
    protocols = [json.loads((folder / "result.json").read_text())["protocol"] for folder in (usual, masked)]
    assert [protocol["control"] for protocol in protocols] == ["another", "zeros"]
    assert {words for record in records for _, words in record.thoughts} == {NOTHING}
    with pytest.raises(ConfigError, match=r"planner\.control"):
        evaluate_checkpoint(last, "held_out", Interruption(), homes=homes, control="ones")


def test_a_perfect_planner_is_worth_nothing_without_its_words(smoke: TrainConfig) -> None:
    config = change_config(smoke, overrides=["planner.control=constant", "env.max_steps=80"])
    found = {}
    for name in ("none", "constant"):
        setting = Setting(config.with_control(name))
        with PrivilegedPlanner() as planner:
            protocol, records = evaluate_agent("planner", parse_home_set("val:0-1"), 6, setting, planner)
        assert protocol["control"] == name
        found[name] = sum(record.measures["success"] for record in records)
    assert found["constant"] < found["none"]


def test_controls_repeat_in_evaluations(smoke: TrainConfig) -> None:
    setting = Setting(smoke.with_control("random"))
    played = []
    for _ in range(2):
        with EmbeddedPlanner() as planner:
            played.append(evaluate_agent("planner", parse_home_set("val:0-1"), 2, setting, planner)[1])
    assert [record.path for record in played[0]] == [record.path for record in played[1]]
