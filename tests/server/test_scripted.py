"""The scripted planner: repeatable, weighted, and declared as what it is."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from thinknav_proto import PlannerFailed
from thinknav_server.planners import Plan, PlanItem, Script, ScriptedPlanner, load_script


def item(seed: int, goal: str = "chair") -> PlanItem:
    return PlanItem(np.random.default_rng(seed).integers(0, 256, (8, 8, 3), dtype=np.uint8), goal)


def sentences(planner: ScriptedPlanner, items: list[PlanItem]) -> list[str]:
    answers = planner.plan(items)
    return [answer.instructions[0] for answer in answers if isinstance(answer, Plan)]


def test_the_same_frame_and_goal_get_the_same_sentence_in_any_batch() -> None:
    items = [item(seed) for seed in range(50)]
    together = sentences(ScriptedPlanner(), items)
    assert together == [sentences(ScriptedPlanner(), [one])[0] for one in items]
    assert len(set(together)) >= 5
    assert sentences(ScriptedPlanner(), [item(seed, "bed") for seed in range(50)]) != together


def test_the_goal_is_named_and_a_plan_has_several_steps() -> None:
    script = Script.model_validate({"default": ["go to the {goal}"]})
    assert sentences(ScriptedPlanner(script), [item(0, "sofa")]) == ["go to the sofa"]
    frame = item(0).frame
    (plan,) = ScriptedPlanner().plan([PlanItem(frame, "sofa", mode="plan")])
    assert isinstance(plan, Plan)
    assert len(plan.instructions) == 4
    assert plan.confidence is None


def test_sentences_are_said_in_proportion_to_their_weights() -> None:
    script = Script.model_validate({"default": [{"say": "left", "weight": 3}, {"say": "right", "weight": 1}]})
    said = Counter(sentences(ScriptedPlanner(script), [item(seed) for seed in range(800)]))
    assert 0.7 < said["left"] / 800 < 0.8


def test_the_revision_changes_with_the_script() -> None:
    revisions = {ScriptedPlanner(script).identity.revision for script in (None, Script(), Script(goals={}))}
    assert len(revisions) == 1
    other = Script.model_validate({"default": ["left"]})
    assert ScriptedPlanner(other).identity.revision not in revisions
    assert ScriptedPlanner(other).identity.name == "scripted"


def test_failures_are_drawn_from_the_seed() -> None:
    def failures(seed: int) -> list[bool]:
        planner = ScriptedPlanner(failure_rate=0.3, seed=seed)
        return [isinstance(answer, PlannerFailed) for answer in planner.plan([item(0)] * 200)]

    assert failures(1) == failures(1) != failures(2)
    assert 30 < sum(failures(1)) < 90


def test_a_script_file_gives_goals_lines_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "script.yaml"
    path.write_text("default: [turn left]\ngoals:\n  bed:\n    - say: move forward to the bed\n      weight: 2\n")
    planner = ScriptedPlanner(load_script(path))
    assert sentences(planner, [item(0, "bed"), item(0, "chair")]) == ["move forward to the bed", "turn left"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("default: []", "default"),
        ("default: [{say: left, weight: 0}]", "weight"),
        ("defualt: [left]", "defualt"),
        ("default: [", "is not YAML"),
        ("3", "is wrong"),
    ],
)
def test_a_wrong_script_file_is_named_with_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "script.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as raised:
        load_script(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_missing_script_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"cannot read the script .*nowhere\.yaml: No such file"):
        load_script(tmp_path / "nowhere.yaml")
