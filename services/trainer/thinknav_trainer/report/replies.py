"""What an agent was told when it asked, and whether it did so. Knows records of episodes; nothing of places."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from thinknav_sim.task_config import Action
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.records import EpisodeRecord

_NAMES = {
    Action.STOP: "stop",
    Action.MOVE_FORWARD: "forward",
    Action.TURN_LEFT: "left",
    Action.TURN_RIGHT: "right",
    None: "no direction",
}


@dataclass(frozen=True)
class Told:
    """share: of all replies those with this direction. followed: of these, those that the next step did; 0 to 1."""

    direction: str
    share: float
    followed: float


def what_it_was_told(records: Sequence[EpisodeRecord]) -> list[Told]:
    """Of each direction that was told, the commonest first; none without replies."""
    told: Counter[Action | None] = Counter()
    followed: Counter[Action | None] = Counter()
    for record in records:
        for step, subgoal in record.thoughts:
            direction = subgoal_direction(subgoal)
            told[direction] += 1
            followed[direction] += direction is not None and record.actions[step + 1 : step + 2] == [direction]
    return [
        Told(_NAMES[direction], count / told.total(), followed[direction] / count)
        for direction, count in told.most_common()
    ]
