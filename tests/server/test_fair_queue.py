"""Clients take turns, whatever else happens to the queue."""

import hypothesis.strategies as st
from hypothesis import given, settings

from thinknav_server.fair_queue import FairQueue

CLIENTS = st.sampled_from("abc")
OPERATIONS = st.lists(
    st.one_of(
        st.tuples(st.just("add"), CLIENTS),
        st.tuples(st.just("take"), st.integers(0, 4)),
        st.tuples(st.just("leave"), st.integers(0, 30)),
        st.tuples(st.just("newest"), st.none()),
    ),
    max_size=60,
)


def test_turns_go_round() -> None:
    queue: FairQueue[str] = FairQueue()
    for job in ("a1", "a2", "a3", "b1", "b2", "c1"):
        queue.add(job[0], job)
    assert queue.ahead_of("a") == 6
    assert queue.ahead_of("c") == 5  # one of its own, two of a and of b
    assert queue.ahead_of("new") == 3
    assert sorted(queue.first_in_line()) == ["a1", "b1", "c1"]
    assert queue.take(4) == ["a1", "b1", "c1", "a2"]
    assert queue.crowd() == ("a", 1) or queue.crowd() == ("b", 1)
    assert queue.take(9) == ["b2", "a3"]
    assert not queue


@given(OPERATIONS)
@settings(deadline=None, max_examples=200)
def test_nothing_is_lost_and_order_holds_within_a_client(operations: list[tuple[str, object]]) -> None:
    queue: FairQueue[int] = FairQueue()
    waiting: dict[int, str] = {}
    for number, (operation, argument) in enumerate(operations):
        if operation == "add":
            queue.add(str(argument), number)
            waiting[number] = str(argument)
        elif operation == "take":
            assert isinstance(argument, int)
            taken = queue.take(argument)
            assert len(taken) == min(argument, len(waiting))
            for job in taken:
                client = waiting.pop(job)
                assert all(job < other for other, whose in waiting.items() if whose == client and other not in taken)
        elif operation == "leave":
            assert isinstance(argument, int)
            client = waiting.pop(argument, "a")
            queue.discard(client, argument)
        elif waiting:
            crowd, count = queue.crowd()
            own = [job for job, client in waiting.items() if client == crowd]
            assert len(own) == count
            assert list(queue.newest(crowd)) == sorted(own, reverse=True)
        assert len(queue) == len(waiting)
    assert sorted(queue.clear()) == sorted(waiting)
