"""Asks a planner about a batch so that an item it chokes on fails alone."""

import logging
from collections.abc import Sequence
from dataclasses import replace

from thinknav_proto import PlannerError, PlannerFailed
from thinknav_server.planners.base import Plan, PlanItem, Planner

logger = logging.getLogger(__name__)


def plan_each(planner: Planner, items: Sequence[PlanItem]) -> list[Plan | PlannerError]:
    """One answer for each item, whatever the planner does.

    A batch that raises is halved until the culprits are found. The search is bounded, for a planner that is
    wholly broken would otherwise be asked twice for each item: when it gives up, what it has not yet settled has
    failed.
    """
    answers: list[Plan | PlannerError] = [PlannerFailed("the planner keeps failing") for _ in items]
    attempts = 4 * len(items).bit_length()  # enough to single out two culprits
    pending = [slice(0, len(items))]
    while pending and attempts:
        part = pending.pop()
        attempts -= 1
        try:
            answers[part] = _ask(planner, items[part])
        except Exception as error:
            middle = (part.start + part.stop) // 2
            if middle > part.start:
                pending += [slice(middle, part.stop), slice(part.start, middle)]
                continue
            logger.exception("the planner failed on one request")
            answers[part] = [_failure(error)]
    return answers


def _ask(planner: Planner, items: Sequence[PlanItem]) -> list[Plan | PlannerError]:
    answers = list(planner.plan(items))
    if len(answers) != len(items):
        raise PlannerFailed(f"the planner gave {len(answers)} answers to {len(items)} items")
    return [checked(answer) for answer in answers]


def _failure(error: Exception) -> PlannerError:
    if isinstance(error, PlannerError):
        return error.as_value()
    return PlannerFailed(f"the planner failed on this request: {type(error).__name__}: {str(error)[:200]}")


def checked(answer: Plan | PlannerError) -> Plan | PlannerError:
    """The answer, or a failure in place of one that no reply could carry."""
    if isinstance(answer, PlannerError):
        return answer
    if not isinstance(answer, Plan):
        return PlannerFailed(f"the planner gave a {type(answer).__name__} where a Plan is due")
    if isinstance(answer.instructions, str):
        return PlannerFailed("the planner gave a text where a tuple of instructions is due")
    if not (answer.instructions and all(answer.instructions)):
        return PlannerFailed("the planner gave an empty answer")
    if not all(isinstance(instruction, str) for instruction in answer.instructions):
        return PlannerFailed("the planner gave instructions that are no text")
    try:
        "".join(answer.instructions).encode()
    except UnicodeEncodeError as error:  # half of a pair of surrogates, which JSON lets through
        return PlannerFailed(f"the planner gave a text that UTF-8 cannot hold: {error.reason}")
    if answer.confidence is None:
        return answer
    confidence = float(answer.confidence)  # a planner's own may be of NumPy, which does not travel
    if not 0 <= confidence <= 1:
        return PlannerFailed(f"the planner gave a confidence of {confidence}, which is not within 0 and 1")
    return replace(answer, instructions=tuple(answer.instructions), confidence=confidence)
