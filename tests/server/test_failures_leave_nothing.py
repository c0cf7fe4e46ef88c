"""A request that failed is gone once it is answered: an error that is an answer holds no frames of the program, and so
no pictures. A soak of half an hour once ended with twice the memory.
"""

import gc
import logging
from collections.abc import Callable, Iterator

import msgpack
import numpy as np
import pytest
import simplejpeg

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import (
    PROTOCOL_VERSION,
    Frame,
    InvalidRequest,
    PlannerError,
    PlannerFailed,
    SubgoalRequest,
    decode_requests,
)
from thinknav_server.bench.planner import POISON, EmulatedPlanner
from thinknav_server.images import PixelMemory
from thinknav_server.thinking import Thinker, decoded_batch

THINKER = Thinker(EmulatedPlanner("0", "0"), shipped_text_encoder())
PICTURE = simplejpeg.encode_jpeg(np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8))

MALFORMED: bytes = msgpack.packb({"version": PROTOCOL_VERSION, "requests": [{"goal": 5}]})


@pytest.fixture
def nothing_is_collected() -> Iterator[None]:
    """Things go when the last reference to them goes, and not otherwise."""
    logging.disable(logging.CRITICAL)
    gc.collect()
    gc.disable()
    yield
    gc.enable()
    logging.disable(logging.NOTSET)


def answers(goal: str, picture: bytes) -> list[object]:
    request = SubgoalRequest(request_id="1", goal=goal, frame=Frame(encoding="jpeg", data=picture))
    return list(THINKER.think_decoded(decoded_batch([request], PixelMemory())))


@pytest.mark.usefixtures("nothing_is_collected")
@pytest.mark.parametrize(
    ("fail", "error"),
    [
        (lambda: answers("chair", PICTURE[: len(PICTURE) // 2]), InvalidRequest),
        (lambda: answers(POISON, PICTURE), PlannerFailed),
        (lambda: decode_requests(MALFORMED), InvalidRequest),
    ],
    ids=["half a JPEG", "one that breaks the planner", "a request that is none"],
)
def test_nothing_is_left_of_a_request_that_failed(fail: Callable[[], list[object]], error: type[PlannerError]) -> None:
    fail()  # what is made once, is made
    gc.collect()
    [answer] = fail()
    assert isinstance(answer, error)
    assert (answer.__traceback__, answer.__context__, answer.__cause__) == (None, None, None)
    del answer
    assert gc.collect() == 0
