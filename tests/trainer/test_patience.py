import numpy as np
import pytest

from thinknav_proto import PlannerFailed, SubgoalReply, Unavailable
from thinknav_trainer.patience import Patience
from thinknav_trainer.planner import SubgoalRequest, encode_frame, reply_to


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def answer() -> SubgoalReply:
    frame = encode_frame(np.zeros((2, 2, 3), np.uint8), "raw")
    return reply_to(SubgoalRequest(request_id="1", goal="chair", frame=frame), "turn left")


def test_time_counts_from_the_first_failure_in_a_row() -> None:
    clock = Clock()
    patience = Patience(10, clock)
    clock.now = 100  # nobody thought for long
    patience.observe([PlannerFailed("a")])
    clock.now = 109
    patience.observe([PlannerFailed("b"), answer()])  # one answer is enough
    clock.now = 118
    patience.observe([PlannerFailed("c")])
    clock.now = 127.9
    patience.observe([])
    patience.observe([PlannerFailed("d")])
    clock.now = 128
    with pytest.raises(Unavailable, match=r"not answered for 10 s \(think.patience is 10 s\): e"):
        patience.observe([PlannerFailed("e")])
