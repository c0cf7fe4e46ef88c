"""Centre and scale of thoughts, so that the policy's first layer feels their differences.

Embeddings of unit norm have tiny elements, and those of sentences about one matter lie close together (in CLIP's text
space they share most of their length). The affine is fixed, from the embeddings of sentences such as planners say, and
travels with the weights. Running statistics would move under the policy: what it saw when it acted would not be what it
sees when it learns, and the first thoughts, on which it depends whether thinking survives, would come unscaled.
"""

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scene import GOAL_CATEGORIES

_DIRECTIONS = ("turn left", "turn right", "move forward", "go straight ahead", "stop")
_PLACES = ("to the {goal}", "toward the doorway", "into the next room", "along the wall", "and look for the {goal}")


def typical_sentences() -> list[str]:
    """What planners say, and how tasks are described, for every goal."""
    goals = [goal.replace("_", " ") for goal in GOAL_CATEGORIES]
    subgoals = {f"{way} {place.format(goal=goal)}" for way, place, goal in product(_DIRECTIONS, _PLACES, goals)}
    return [f"find a {goal}" for goal in goals] + list(_DIRECTIONS) + sorted(subgoals)


def centre_and_scale(embeddings: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
    """(D,) and a factor, so that the elements of (embedding - centre) x factor have unit variance over (S, D)."""
    centre = embeddings.mean(axis=0)
    variance = float(np.square(embeddings - centre).mean())
    return centre, 1 / math.sqrt(variance)
