"""A planner that chokes on one item answers all others."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
import pytest

from thinknav_proto import PlannerError, PlannerFailed, Unavailable
from thinknav_server.planners import Plan, PlanItem, PlannerIdentity
from thinknav_server.planners.isolate import plan_each

FRAME = np.zeros((2, 2, 3), np.uint8)


class Choosy:
    """Raises on batches that hold one of some goals; else repeats the goals."""

    identity = PlannerIdentity("choosy", "1", "none")

    def __init__(self, poison: Sequence[str], error: Exception) -> None:
        self.poison = poison
        self.error = error
        self.calls = 0

    def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
        self.calls += 1
        if any(item.goal in self.poison for item in items):
            raise self.error
        return [Plan((item.goal,)) for item in items]


def ask(planner: Choosy, count: int) -> list[Plan | PlannerError]:
    return plan_each(planner, [PlanItem(FRAME, str(index)) for index in range(count)])


@pytest.mark.parametrize("count", [1, 2, 7, 64])
@pytest.mark.parametrize("poison", [0, -1])
def test_one_poison_item_fails_alone(count: int, poison: int) -> None:
    culprit = str(range(count)[poison])
    planner = Choosy([culprit], RuntimeError("out of memory"))
    for index, answer in enumerate(ask(planner, count)):
        if str(index) == culprit:
            assert isinstance(answer, PlannerFailed)
            assert "RuntimeError: out of memory" in answer.message
        else:
            assert answer == Plan((str(index),))


def test_two_poison_items_in_a_large_batch_fail_alone() -> None:
    answers = ask(Choosy(["5", "60"], RuntimeError("broken")), 64)
    assert [index for index, answer in enumerate(answers) if isinstance(answer, PlannerFailed)] == [5, 60]


def test_a_planner_that_is_wholly_broken_is_not_asked_for_ever() -> None:
    planner = Choosy([str(index) for index in range(64)], RuntimeError("broken"))
    assert all(isinstance(answer, PlannerFailed) for answer in ask(planner, 64))
    assert planner.calls <= 28


def test_a_planner_error_keeps_its_kind() -> None:
    (answer,) = ask(Choosy(["0"], Unavailable("its server is away")), 1)
    assert isinstance(answer, Unavailable)


@pytest.mark.parametrize("answers", [[], [Plan(("left",)), Plan(("right",))]])
def test_a_wrong_number_of_answers_is_a_failure(answers: list[Plan]) -> None:
    class Miscounting(Choosy):
        def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
            return answers

    (answer,) = ask(Miscounting([], RuntimeError()), 1)
    assert isinstance(answer, PlannerFailed)


@pytest.mark.parametrize("plan", [Plan(()), Plan(("",))])
def test_an_empty_answer_is_a_failure(plan: Plan) -> None:
    class Silent(Choosy):
        def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
            return [plan]

    (answer,) = ask(Silent([], RuntimeError()), 1)
    assert isinstance(answer, PlannerFailed)


@pytest.mark.parametrize("confidence", [1.0000001, -0.1, float("nan")])
def test_a_confidence_that_no_reply_can_carry_fails_its_item_alone(confidence: float) -> None:
    class Sure(Choosy):
        def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
            return [
                Plan(("go on",), confidence if item.goal == "1" else cast(float, np.float32(0.5))) for item in items
            ]

    first, second = ask(Sure([], RuntimeError()), 2)
    assert isinstance(first, Plan)
    assert (first.instructions, type(first.confidence), first.confidence) == (("go on",), float, 0.5)
    assert isinstance(second, PlannerFailed)
    assert "confidence" in str(second)


@pytest.mark.parametrize("answer", ["go on", ("go on",), Plan(cast(tuple[str, ...], (3,)))])
def test_what_is_no_plan_is_a_failure(answer: Any) -> None:
    class Blunt(Choosy):
        def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
            return [answer]

    (told,) = ask(Blunt([], RuntimeError()), 1)
    assert isinstance(told, PlannerFailed)


def test_a_text_that_no_reply_can_carry_fails_its_item_alone() -> None:
    class Odd(Choosy):
        def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
            return [Plan(("turn left \ud83d",) if item.goal == "1" else ("turn left",)) for item in items]

    first, second = ask(Odd([], RuntimeError()), 2)
    assert isinstance(first, Plan)
    assert isinstance(second, PlannerFailed)
    assert "surrogates not allowed" in str(second)


def test_a_forgotten_comma_is_told() -> None:
    """Else the first letter would be the subgoal."""

    class Loose(Choosy):
        def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
            return [Plan(cast(tuple[str, ...], "turn left"))]

    (told,) = ask(Loose([], RuntimeError()), 1)
    assert isinstance(told, PlannerFailed)
    assert "a text where a tuple of instructions is due" in str(told)


def test_no_items_ask_nothing_of_the_planner() -> None:
    planner = Choosy([], RuntimeError())
    assert ask(planner, 0) == []
    assert planner.calls == 0
