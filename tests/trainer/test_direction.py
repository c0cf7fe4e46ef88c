import pytest

from thinknav_sim.task_config import Action
from thinknav_trainer.direction import subgoal_direction


@pytest.mark.parametrize(
    ("subgoal", "action"),
    [
        ("turn left to the doorway", Action.TURN_LEFT),
        ("Turn RIGHT, then go on", Action.TURN_RIGHT),
        ("move forward...", Action.MOVE_FORWARD),
        ("go straight ahead to the sofa on the right", Action.MOVE_FORWARD),
        ("turn left at the lamp right ahead", Action.TURN_LEFT),
        ("stop, the chair is right ahead", Action.STOP),
        ("the bed is right in front", Action.MOVE_FORWARD),
        ("walk right ahead", Action.MOVE_FORWARD),
        ("keep to the right", Action.TURN_RIGHT),
        ("move forwards", Action.MOVE_FORWARD),
        ("look around the room", None),
        ("the leftovers are in the bright kitchen", None),
        ("", None),
    ],
)
def test_direction_of_a_subgoal(subgoal: str, action: Action | None) -> None:
    assert subgoal_direction(subgoal) == action
