"""The task's configuration refuses what makes no task."""

import pytest
from pydantic import ValidationError

from thinknav_sim.task_config import Action, ObjectNavConfig


def test_actions_have_habitats_order() -> None:
    assert [action.name for action in Action] == ["STOP", "MOVE_FORWARD", "TURN_LEFT", "TURN_RIGHT", "THINK"]
    assert list(Action) == [0, 1, 2, 3, 4]


def test_think_is_an_action_only_when_asked_for() -> None:
    assert ObjectNavConfig().num_actions == 4
    assert ObjectNavConfig(think_action=True).num_actions == 5


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"widht": 64}, "widht"),
        ({"width": 0}, "greater than or equal to 1"),
        ({"min_depth": 5.0, "max_depth": 5.0}, "min_depth 5.0 must be less than max_depth 5.0"),
        ({"min_depth": 1.0, "max_depth": 1.00000001}, "must be less than max_depth 1.00000001"),
        ({"forward_step": 1e-12}, "greater than or equal to 0.01"),
        ({"success": "nearby"}, "'paper' or 'viewpoint'"),
        ({"slack_reward": 0.1}, "less than or equal to 0"),
    ],
)
def test_nonsense_is_refused(values: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        ObjectNavConfig.model_validate(values)


def test_every_field_is_described() -> None:
    assert all(field.description for field in ObjectNavConfig.model_fields.values())
