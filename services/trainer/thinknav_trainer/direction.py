"""What a subgoal tells the agent to do next, read from its words. Knows nothing of rewards."""

import re

from thinknav_sim.task_config import Action

# In the order in which they are tried at each place: "right ahead" is no turn.
_WORDS: tuple[tuple[str, Action], ...] = (
    (r"stop|halt", Action.STOP),
    (r"(?:right|straight|just) (?:ahead|in front|forward)", Action.MOVE_FORWARD),
    (r"forwards?|straight|ahead", Action.MOVE_FORWARD),
    (r"left", Action.TURN_LEFT),
    (r"right", Action.TURN_RIGHT),
)
_DIRECTION = re.compile(
    "|".join(rf"\b(?P<_{index}>{words})\b" for index, (words, _) in enumerate(_WORDS)), re.IGNORECASE
)


def subgoal_direction(subgoal: str) -> Action | None:
    """The first direction word's action ("turn left to the door on the right": TURN_LEFT); None without one."""
    match = _DIRECTION.search(subgoal)
    if match is None or match.lastgroup is None:
        return None
    return _WORDS[int(match.lastgroup.removeprefix("_"))][1]
