"""What an agent was told, and whether it did so."""

from thinknav_sim.task_config import Action
from thinknav_trainer.records import MEASURES, EpisodeRecord
from thinknav_trainer.report.replies import Told, what_it_was_told

STOP, FORWARD, LEFT, RIGHT, THINK = Action


def record(actions: list[Action], thoughts: list[tuple[int, str]]) -> EpisodeRecord:
    path = [[0.0] * 4] * len(actions)
    measures = dict.fromkeys(MEASURES, 0.0)
    return EpisodeRecord("e", "h", "bed", measures, {}, path, [int(a) for a in actions], thoughts, None, None)


def test_replies_are_counted_by_direction_and_by_whether_the_next_step_followed() -> None:
    first = record([THINK, LEFT, THINK, FORWARD, THINK], [(0, "turn left"), (2, "turn left"), (4, "turn right")])
    second = record([LEFT, THINK, STOP], [(1, "stop, the bed is right ahead")])
    third = record([THINK, FORWARD], [(0, "nothing in sight")])
    assert what_it_was_told([first, second, third]) == [
        Told("left", 2 / 5, 0.5),
        Told("right", 1 / 5, 0.0),  # the episode ended with the think: nothing followed
        Told("stop", 1 / 5, 1.0),
        Told("no direction", 1 / 5, 0.0),
    ]


def test_who_never_asks_was_told_nothing() -> None:
    assert what_it_was_told([record([LEFT, STOP], [])]) == []
