"""Remembers what the planner said about a frame. Only for answers that do not depend on chance."""

import hashlib
from collections import OrderedDict

from thinknav_proto import SubgoalRequest
from thinknav_server.thinking import Thought


def question_key(request: SubgoalRequest) -> bytes | None:
    """32 bytes, equal for requests that ask the same; None for one whose answer is drawn at random."""
    if request.temperature > 0:
        return None
    goal = request.goal.encode()
    digest = hashlib.sha256(f"{request.mode} {len(goal)}\0".encode() + goal)
    for frame in request.frames:
        head = f"{frame.encoding} {frame.width} {frame.height} {frame.heading!r} {len(frame.data)}\0"
        digest.update(head.encode())
        digest.update(frame.data)
    return digest.digest()


class ReplyCache:
    """The answers to the `size` questions that were asked last; a size of 0 remembers nothing.

    A thousand answers take about 3 MB.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._thoughts: OrderedDict[bytes, Thought] = OrderedDict()

    def __len__(self) -> int:
        return len(self._thoughts)

    def get(self, key: bytes | None) -> Thought | None:
        """What was said to the question, if that is remembered."""
        thought = self._thoughts.get(key) if key else None
        if key and thought is not None:
            self._thoughts.move_to_end(key)
        return thought

    def put(self, key: bytes | None, thought: Thought) -> None:
        """Remember an answer, and forget the one that was asked for least recently."""
        if not key or not self._size:
            return
        self._thoughts[key] = thought
        self._thoughts.move_to_end(key)
        if len(self._thoughts) > self._size:
            self._thoughts.popitem(last=False)
