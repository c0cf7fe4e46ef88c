"""Answers are remembered for equal questions, and only for those."""

import numpy as np
import pytest

from thinknav_proto import Frame, SubgoalRequest
from thinknav_server.planners import Plan
from thinknav_server.reply_cache import ReplyCache, question_key
from thinknav_server.thinking import Thought

RGB = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)


def request(**fields: object) -> SubgoalRequest:
    values: dict[str, object] = {"request_id": "1", "goal": "chair", "frame": Frame.raw(RGB)}
    return SubgoalRequest.model_validate(values | fields)


def thought(text: str) -> Thought:
    return Thought(Plan((text,)), np.zeros(512, np.float32), 0.1, 0.1)


def test_the_same_question_has_the_same_key_whoever_asks() -> None:
    assert question_key(request()) == question_key(request(request_id="2", deadline=5.0))


@pytest.mark.parametrize(
    "other",
    [
        {"goal": "bed"},
        {"mode": "plan"},
        {"frame": Frame.raw(RGB[::-1])},
        {"frame": Frame.raw(RGB.reshape(2, 8, 3))},
        {"recent": (Frame.raw(RGB),)},
        {"recent": (Frame.raw(RGB, heading=0.5),)},
        {"frame": Frame(encoding="png", data=RGB.tobytes())},
    ],
)
def test_another_question_has_another_key(other: dict[str, object]) -> None:
    assert question_key(request(**other)) != question_key(request())


def test_a_goal_cannot_pass_for_a_goal_and_a_frame() -> None:
    pixels = np.full((4, 4, 3), ord("0"), np.uint8)
    pixels[-1, -1, -1] = 0
    frame = Frame.raw(pixels)
    said = f"{frame.encoding} {frame.width} {frame.height} {frame.heading!r} {len(frame.data)}\0{frame.data.decode()}"
    one, other = request(frame=frame, recent=(frame,)), request(frame=frame, goal=f"chair\0{said[:-1]}")
    assert question_key(one) != question_key(other)


def test_views_are_told_apart_by_their_headings() -> None:
    left, right = (request(recent=(Frame.raw(RGB, heading=heading),)) for heading in (0.5, -0.5))
    assert question_key(left) != question_key(right)


def test_an_answer_drawn_at_random_is_not_remembered() -> None:
    assert question_key(request(temperature=0.1)) is None
    cache = ReplyCache(4)
    cache.put(None, thought("left"))
    assert len(cache) == 0
    assert cache.get(None) is None


def test_the_answer_asked_for_least_recently_is_forgotten() -> None:
    cache = ReplyCache(2)
    left, right, ahead = thought("left"), thought("right"), thought("ahead")
    cache.put(b"l", left)
    cache.put(b"r", right)
    assert cache.get(b"l") is left
    cache.put(b"a", ahead)
    assert (cache.get(b"l"), cache.get(b"r"), cache.get(b"a")) == (left, None, ahead)


def test_a_cache_of_no_size_remembers_nothing() -> None:
    cache = ReplyCache(0)
    cache.put(b"l", thought("left"))
    assert cache.get(b"l") is None
