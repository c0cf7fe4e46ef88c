"""The subgoals that the teacher writes: a direction, and what to go by.

The direction comes from the map; what is gone by is only what is to be seen: the goal, a doorway that the way leads
through, something that stands beside it. Knows nothing of poses and pictures.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thinknav_models.subgoal_language import DIRECTIONS, words_of
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_trainer.visible import SeenObject

# By Action.
_DIRECTION_WORDS = dict(
    zip((Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT), DIRECTIONS, strict=True)
)
_FOUND = (
    ", the {goal} is right ahead",
    ", the {goal} is in front of you",
    " at the {goal}",
    " here, you reached the {goal}",
)
_TO_GOAL = (" to the {goal}", " toward the {goal}", " until you reach the {goal}")
_TURN_TO_GOAL = (" to the {goal}", " toward the {goal}", " to face the {goal}")
_TURN_TO_DOORWAY = (" toward the doorway", " to the doorway", " to leave the {here}", " toward the {there}")
_TO_DOORWAY = (" to the doorway", " toward the doorway", " toward the {there}")
_THROUGH_DOORWAY = (" through the doorway", " into the {there}", " through the doorway into the {there}")
_PAST = (" past the {thing}", " along the {thing}", " toward the {thing}")
_SEARCH = (" to look for the {goal}", " to find the {goal}", " to search for the {goal}")
_SEARCH_AHEAD = (" to look for the {goal}", " across the {here}", " to explore the {here}")

_AT_DOORWAY_M = 1.2
_DOORWAY_IN_SIGHT_M = 4.5
_HALF_VIEW_RAD = math.radians(38)
_BESIDE_RAD = math.radians(25)

# What is too flat, too high or too small to go by.
_NO_LANDMARKS = frozenset({"rug", "picture", "mirror", "lamp"})


@dataclass(frozen=True)
class Passage:
    """Where the way leaves the room that one is in. distance: metres of walking; bearing: radians, left positive.

    here, there: the rooms' functions.
    """

    distance: float
    bearing: float
    here: str
    there: str


def words_for(category: str) -> str:
    """A category as people say it."""
    return category.replace("_", " ")


def subgoal_sentence(
    rng: np.random.Generator,
    goal: str,
    action: Action,
    seen: Sequence[SeenObject],
    here: str,
    passage: Passage | None,
) -> str:
    """One subgoal. goal: a category. action: where the way leads. seen: the objects in view. here: the room, or "room".

    passage: where the way leaves the room, None when it does not.
    """
    ending, thing = _ending(rng, goal, action, seen, passage)
    there = passage.there if passage else here
    words = _DIRECTION_WORDS[action] + str(rng.choice(ending))
    return words.format(goal=words_for(goal), here=here, there=there, thing=words_for(thing))


def _ending(
    rng: np.random.Generator, goal: str, action: Action, seen: Sequence[SeenObject], passage: Passage | None
) -> tuple[Sequence[str], str]:
    """The endings that fit, and the thing that some of them name."""
    if action == Action.STOP:
        return _FOUND, goal
    turning = action != Action.MOVE_FORWARD
    if any(item.category == goal and _lies_there(item.bearing, action) for item in seen):
        return (_TURN_TO_GOAL if turning else _TO_GOAL), goal
    if passage and passage.distance < _DOORWAY_IN_SIGHT_M and abs(passage.bearing) < _HALF_VIEW_RAD:
        if turning and _lies_there(passage.bearing, action):
            return _TURN_TO_DOORWAY, ""
        if not turning:
            return (_THROUGH_DOORWAY if passage.distance < _AT_DOORWAY_M else _TO_DOORWAY), ""
    things = [item for item in seen if item.category not in _NO_LANDMARKS and _lies_there(item.bearing, action)]
    if things and rng.random() < 0.7:
        return _PAST, max(things, key=lambda item: item.share).category
    return (_SEARCH if turning else _SEARCH_AHEAD), ""


def _lies_there(bearing: float, action: Action) -> bool:
    """Whether something at a bearing lies where the action leads."""
    if action == Action.MOVE_FORWARD:
        return abs(bearing) < _BESIDE_RAD
    return bearing > 0 if action == Action.TURN_LEFT else bearing < 0


def all_words(things: Sequence[str], rooms: Sequence[str]) -> tuple[str, ...]:
    """The words that sentences about these things and rooms can hold."""
    endings = [*_FOUND, *_TO_GOAL, *_TURN_TO_GOAL, *_TURN_TO_DOORWAY, *_TO_DOORWAY, *_THROUGH_DOORWAY]
    endings += [*_PAST, *_SEARCH, *_SEARCH_AHEAD]
    names = [words_for(name) for name in (*GOAL_CATEGORIES, *things, *rooms, "room")]
    return words_of([*(ending.format(goal="", here="", there="", thing="") for ending in endings), *names])
