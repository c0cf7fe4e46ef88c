"""What vision-language models are told, and what is made of their words."""

import math
from pathlib import Path

import numpy as np
import pytest

from thinknav_proto import PlannerFailed
from thinknav_server.planners import Plan, PlanItem, View
from thinknav_server.planners.prompt import PLAN_LENGTH, heading_in_words, load_prompt, plan_from_text

FRAME = np.zeros((4, 4, 3), np.uint8)
OLD = np.ones((4, 4, 3), np.uint8)


def texts(item: PlanItem) -> str:
    return " | ".join(part if isinstance(part, str) else "IMAGE" for part in load_prompt(None).parts(item))


def test_one_frame_comes_before_the_question() -> None:
    said = texts(PlanItem(FRAME, "potted plant"))
    assert said.startswith("IMAGE | The robot looks for a potted plant.")
    assert "one short instruction" in said
    assert "{" not in said
    assert f"at most {PLAN_LENGTH} short instructions" in texts(PlanItem(FRAME, "bed", mode="plan"))


def test_earlier_views_come_first_with_their_headings() -> None:
    item = PlanItem(FRAME, "bed", recent=(View(OLD, math.pi / 2), View(OLD, -0.35)))
    said = texts(item).split(" | ")
    assert said[:6] == [
        "An earlier view, 90 degrees to the left:",
        "IMAGE",
        "An earlier view, 20 degrees to the right:",
        "IMAGE",
        "The view now:",
        "IMAGE",
    ]
    frames = [part for part in load_prompt(None).parts(item) if not isinstance(part, str)]
    assert [int(frame.max()) for frame in frames] == [1, 1, 0]


@pytest.mark.parametrize(
    ("heading", "words"),
    [
        (0.0, "straight ahead"),
        (0.08, "straight ahead"),
        (math.pi, "behind"),
        (-3.1, "behind"),
        (math.tau + 0.5, "30 degrees to the left"),
        (-math.pi / 2, "90 degrees to the right"),
    ],
)
def test_headings_are_told_in_words(heading: float, words: str) -> None:
    assert heading_in_words(heading) == words


def test_the_hash_changes_with_the_words(tmp_path: Path) -> None:
    path = tmp_path / "prompt.yaml"
    words = {"system": "s", "view": "v", "now": "n", "subgoal": "find {goal}", "plan": "plan {goal}"}
    path.write_text("\n".join(f"{name}: {text!r}" for name, text in words.items()))
    first = load_prompt(path).hash
    assert first == load_prompt(path).hash != load_prompt(None).hash
    path.write_text(path.read_text().replace("find", "seek"))
    assert load_prompt(path).hash != first


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("system: [", "is not YAML"),
        ("system: s", "is wrong: view: Field required"),
        ("{system: s, view: v, now: n, subgoal: go, plan: 'find {goal}'}", "subgoal needs {goal}"),
        ("{system: s, view: v, now: n, subgoal: '{goal}', plan: '{goal}', more: x}", "more"),
    ],
)
def test_a_wrong_prompt_says_what_is_wrong(content: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "prompt.yaml"
    path.write_text(content)
    with pytest.raises(ValueError) as raised:
        load_prompt(path)
    assert str(path) in str(raised.value)
    assert message in str(raised.value)


def test_a_prompt_that_is_not_there() -> None:
    with pytest.raises(ValueError, match=r"cannot read the prompt nowhere\.yaml: No such file"):
        load_prompt(Path("nowhere.yaml"))


ONE = PlanItem(FRAME, "bed")
MANY = PlanItem(FRAME, "bed", mode="plan")


@pytest.mark.parametrize(
    ("text", "item", "instructions"),
    [
        ("turn left", ONE, ("turn left",)),
        ('\n\n "turn left"\nbecause of the door', ONE, ("turn left",)),
        ("1. turn left\n2) move forward\n\n- stop\n* (done)", MANY, ("turn left", "move forward", "stop", "(done)")),
        ("\n".join(f"{n}. go {n}" for n in range(1, 20)), MANY, tuple(f"go {n}" for n in range(1, PLAN_LENGTH + 1))),
        ("x" * 1000, ONE, ("x" * 200,)),
    ],
)
def test_words_become_instructions(text: str, item: PlanItem, instructions: tuple[str, ...]) -> None:
    assert plan_from_text(text, item) == Plan(instructions)


@pytest.mark.parametrize("text", ["", "\n \n", "...", '""', "- "])
def test_nothing_said_is_a_failure(text: str) -> None:
    assert isinstance(plan_from_text(text, ONE), PlannerFailed)
