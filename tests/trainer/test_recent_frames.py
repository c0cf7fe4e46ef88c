"""What the planner is shown beside the present frame, on the real simulator."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_proto import Frame, SubgoalRequest
from thinknav_sim.task_config import Action
from thinknav_trainer.checkpoint import Checkpoint

STOP, FORWARD, LEFT, RIGHT, THINK = Action
THIRTY = [LEFT, LEFT, LEFT]


class Asked:
    """A planner that keeps what it is asked."""

    def __init__(self) -> None:
        self.requests: list[SubgoalRequest] = []

    def __call__(self, request: SubgoalRequest) -> str:
        self.requests.append(request)
        return "look around"


def both(action: Action) -> NDArray[np.int64]:
    return np.array([action, action], np.int64)


def pixels(frame: Frame) -> NDArray[np.uint8]:
    return np.frombuffer(frame.data, np.uint8).reshape(32, 32, 3)


def test_by_default_one_frame_is_shown(thinking_env: MakeThinkingEnv) -> None:
    asked = Asked()
    env = thinking_env(asked)
    env.reset()
    for action in [*THIRTY, THINK]:
        env.step(both(action))
    assert [(request.recent, request.temperature) for request in asked.requests] == [((), 0.0)] * 2


def test_distinct_views_come_with_their_headings_oldest_first(thinking_env: MakeThinkingEnv) -> None:
    asked = Asked()
    env = thinking_env(asked, frame_encoding="raw", frame_size=32, context=3, temperature=0.7)
    seen = [env.reset()["rgb"]]
    seen += [env.step(both(action)).observations["rgb"] for action in [*THIRTY, *THIRTY, *THIRTY, THINK]]
    for row, request in enumerate(asked.requests):
        assert request.temperature == 0.7
        assert [round(math.degrees(frame.heading)) for frame in request.recent] == [-60, -30]
        np.testing.assert_array_equal(pixels(request.recent[0]), seen[3][row])
        np.testing.assert_array_equal(pixels(request.recent[1]), seen[6][row])
        np.testing.assert_array_equal(pixels(request.frame), seen[9][row])
        assert request.frame.heading == 0


def test_views_are_forgotten_with_their_episode(thinking_env: MakeThinkingEnv) -> None:
    asked = Asked()
    env = thinking_env(asked, context=4)
    env.reset()
    for action in THIRTY:
        env.step(both(action))
    env.step(np.array([STOP, LEFT], np.int64))
    env.step(both(THINK))
    assert [len(request.recent) for request in asked.requests] == [0, 1]
    env.reset()
    env.step(both(THINK))
    assert [len(request.recent) for request in asked.requests[2:]] == [0, 0]


@pytest.mark.parametrize("encoding", ["raw", "jpeg"])
def test_views_outlive_a_checkpoint(thinking_env: MakeThinkingEnv, tmp_path: Path, encoding: str) -> None:
    one, other = Asked(), Asked()
    before, after = (thinking_env(asked, frame_encoding=encoding, frame_size=32, context=4) for asked in (one, other))
    before.reset()
    after.reset()
    for action in [*THIRTY, *THIRTY]:
        before.step(both(action))
    Checkpoint({}, (), None, 0, 1, {}, before.state_dict()).save(tmp_path / "a.pt")
    after.load_state_dict(Checkpoint.load(tmp_path / "a.pt").state)
    for env in (before, after):
        env.step(both(FORWARD))
        env.step(both(THINK))
    assert len(one.requests[0].recent) >= 2
    assert one.requests == other.requests
