"""The batcher: batches form, the queue is bounded, deadlines hold, and whoever leaves frees a place."""

import asyncio
from collections.abc import Sequence

import pytest

from tests.server.gated_batches import GatedWork, batcher_of, run, settle, submit
from thinknav_proto import DeadlineExceeded, InvalidRequest, Overloaded, PlannerError, PlannerFailed, Unavailable
from thinknav_server.batcher import Batched, Batcher


def test_what_arrives_together_is_one_batch_in_order() -> None:
    batches: list[list[int]] = []

    def work(items: Sequence[int]) -> Sequence[int]:
        batches.append(list(items))
        return [2 * item for item in items]

    async def test() -> None:
        async with batcher_of(work) as batcher:
            answers = await asyncio.gather(*(batcher.submit(item, 30) for item in range(6)))
        assert [answer.result for answer in answers] == [0, 2, 4, 6, 8, 10]
        assert batches == [[0, 1, 2, 3], [4, 5]]

    run(test)


def test_what_arrives_while_the_worker_is_busy_is_the_next_batch() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work) as batcher:
            first = submit(batcher, 1)
            await work.wait_until_it_works()
            rest = [submit(batcher, item) for item in (2, 3)]
            await settle()
            work.gate.release(2)
            results = [(await task).result for task in (first, *rest)]
        assert results == [2, 4, 6]
        assert work.batches == [[1], [2, 3]]

    run(test)


def test_a_lone_item_waits_for_others_as_long_as_it_may() -> None:
    async def test() -> None:
        work = GatedWork()
        work.gate.release(9)
        async with batcher_of(work, max_batch=2, max_wait=20.0) as batcher:
            first = submit(batcher, 1)
            await settle()
            assert work.batches == []
            await asyncio.gather(first, submit(batcher, 2))
        async with batcher_of(work, max_batch=2, max_wait=0.01) as batcher:
            await submit(batcher, 3)
        assert work.batches == [[1, 2], [3]]

    run(test)


def test_nobody_waits_for_more_than_there_were_lately() -> None:
    async def test() -> None:
        work = GatedWork()
        work.gate.release(9)
        async with batcher_of(work, max_batch=4, max_wait=20.0) as batcher:
            await asyncio.gather(*(submit(batcher, item) for item in range(4)))
            two = [submit(batcher, item) for item in (4, 5)]
            await settle()
            assert work.batches == [[0, 1, 2, 3]]  # four are expected
            await asyncio.gather(*two, *(submit(batcher, item) for item in (6, 7)))
        async with batcher_of(work, max_batch=4, max_wait=0.3) as batcher:
            in_vain, alone = await submit(batcher, 8), await submit(batcher, 9)
            assert in_vain.queued > 0.2 > alone.queued
        assert work.batches[1:] == [[4, 5, 6, 7], [8], [9]]

    run(test)


def test_a_full_batch_is_given_away_ahead_and_still_counts_as_waiting() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=2, queue_size=4, ahead=1) as batcher:
            first = [submit(batcher, item) for item in (1, 2)]
            await work.wait_until_it_works()
            half = submit(batcher, 3)
            await settle()
            assert work.batches == [[1, 2]]  # it may still grow
            rest = [submit(batcher, item) for item in (4, 5, 6)]
            await work.wait_until_it_works()
            await settle()
            assert work.batches == [[1, 2], [3, 4]]
            assert batcher.waiting == 4
            with pytest.raises(Overloaded, match="4 requests are waiting"):
                await batcher.submit(7, 30)
            work.gate.release(9)
            answers = [await task for task in (*first, half, *rest)]
        assert [answer.result for answer in answers] == [2, 4, 6, 8, 10, 12]
        assert work.batches == [[1, 2], [3, 4], [5, 6]]

    run(test)


def test_what_is_given_away_ahead_waits_until_its_turn() -> None:
    async def work(items: Sequence[int]) -> Sequence[int]:
        async with turn:
            await asyncio.sleep(0.2)
            return items

    turn = asyncio.Lock()
    seconds: list[float] = []

    async def test() -> None:
        told = Batcher(
            work, max_batch=1, max_wait=0.0, queue_size=4, ahead=1, on_batch=lambda _, took: seconds.append(took)
        )
        async with told:
            first, second = await asyncio.gather(told.submit(1, 30), told.submit(2, 30))
        assert first.queued < 0.15 <= second.queued

    run(test)
    assert len(seconds) == 2
    assert all(0.15 <= took < 0.35 for took in seconds)


def test_a_queue_of_one_batch_gives_nothing_away_ahead() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=2, queue_size=2, ahead=1) as batcher:
            greedy = [submit(batcher, item, client="greedy") for item in (1, 2)]
            await work.wait_until_it_works()
            greedy += [submit(batcher, item, client="greedy") for item in (3, 4)]
            await settle()
            modest = submit(batcher, 5, client="modest")
            await settle()
            work.gate.release(9)
            assert (await modest).result == 10
            with pytest.raises(Overloaded):
                await greedy.pop()
            await asyncio.gather(*greedy)

    run(test)


def test_a_full_queue_refuses_at_once_and_says_when_to_come_back() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, queue_size=2) as batcher:
            first = submit(batcher, 1)
            await work.wait_until_it_works()
            waiting = [submit(batcher, item) for item in (2, 3)]
            await settle()
            assert batcher.waiting == 2
            with pytest.raises(Overloaded, match="queue is full") as refused:
                await batcher.submit(4, 30)
            assert refused.value.retry_after > 0
            work.gate.release(2)
            await asyncio.gather(first, *waiting)
        assert work.batches == [[1], [2, 3]]

    run(test)


def test_what_cannot_be_served_in_time_is_refused_at_once() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=1) as batcher:
            slow = submit(batcher, 1)
            await work.wait_until_it_works()
            await asyncio.sleep(0.2)
            work.gate.release()
            await slow
            running, waiting = submit(batcher, 2), submit(batcher, 3)
            await work.wait_until_it_works()
            with pytest.raises(Overloaded, match=r"the deadline is 0\.01 s"):
                await batcher.submit(4, 0.01)
            work.gate.release(2)
            await asyncio.gather(running, waiting)

    run(test)


def test_a_deadline_passes_and_frees_the_place() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work) as batcher:
            first = submit(batcher, 1)
            await work.wait_until_it_works()
            with pytest.raises(DeadlineExceeded, match=r"0\.01 s"):
                await batcher.submit(2, 0.01)
            assert batcher.waiting == 0
            work.gate.release()
            await first
        assert work.batches == [[1]]

    run(test)


def test_a_client_that_cancels_frees_its_place() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, queue_size=1) as batcher:
            first = submit(batcher, 1)
            await work.wait_until_it_works()
            leaving = submit(batcher, 2)
            await settle()
            leaving.cancel()
            await asyncio.wait([leaving])
            staying = submit(batcher, 3)
            await settle()
            work.gate.release(2)
            assert (await staying).result == 6
            await first
        assert work.batches == [[1], [3]]

    run(test)


def test_a_client_that_cancels_in_mid_batch_harms_nobody() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work) as batcher:
            leaving, staying = submit(batcher, 1), submit(batcher, 2)
            await work.wait_until_it_works()
            leaving.cancel()
            work.gate.release()
            assert (await staying).result == 4

    run(test)


def test_an_error_for_one_item_reaches_it_alone() -> None:
    def work(items: Sequence[int]) -> Sequence[int | PlannerError]:
        return [InvalidRequest("odd") if item % 2 else item for item in items]

    async def test() -> None:
        async with batcher_of(work) as batcher:
            odd, even = await asyncio.gather(batcher.submit(1, 30), batcher.submit(2, 30), return_exceptions=True)
        assert isinstance(odd, InvalidRequest)
        assert isinstance(even, Batched)

    run(test)


@pytest.mark.parametrize("results", [RuntimeError("broken"), [1, 2, 3]])
def test_a_batch_that_fails_does_not_stop_the_next(results: object) -> None:
    def work(items: Sequence[int]) -> Sequence[int]:
        if items == [1]:
            if isinstance(results, list):
                return results
            raise RuntimeError
        return items

    async def test() -> None:
        async with batcher_of(work) as batcher:
            with pytest.raises(PlannerFailed):
                await batcher.submit(1, 30)
            assert (await batcher.submit(2, 30)).result == 2

    run(test)


def test_stopping_refuses_what_waits_and_what_comes() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work) as batcher:
            running = submit(batcher, 1)
            await work.wait_until_it_works()
            waiting = submit(batcher, 2)
            await settle()
            assert batcher.running
            asyncio.get_running_loop().call_later(0.05, work.gate.release)
        for task in (running, waiting):
            with pytest.raises(Unavailable, match="stopping"):
                await task
        assert not batcher.running
        with pytest.raises(Unavailable, match="not running"):
            await batcher.submit(3, 30)
        assert work.batches == [[1]]

    run(test)


def test_what_several_ask_alike_is_worked_on_once() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work) as batcher:
            first = submit(batcher, 1, key="a")
            await work.wait_until_it_works()
            same = submit(batcher, 1, key="a")
            other = submit(batcher, 2, key="b")
            leaving, staying = submit(batcher, 3, key="c"), submit(batcher, 3, key="c")
            await settle()
            assert batcher.waiting == 2
            leaving.cancel()
            work.gate.release(9)
            answers = await asyncio.gather(first, same, other, staying)
            assert [answer.result for answer in answers] == [2, 2, 4, 6]
            assert [answer.shared for answer in answers] == [False, True, False, True]
            await batcher.submit(1, 30, key="a")  # which is over, so that it is asked again
        assert work.batches == [[1], [2, 3], [1]]

    run(test)


def test_whoever_asks_alike_has_a_deadline_of_his_own() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work) as batcher:
            running = submit(batcher, 0)
            await work.wait_until_it_works()
            patient = submit(batcher, 1, key="a")
            await settle()
            with pytest.raises(DeadlineExceeded):
                await batcher.submit(1, 0.01, key="a")
            with pytest.raises(DeadlineExceeded):
                await batcher.submit(2, 0.01, key="b")
            again = submit(batcher, 2, key="b")  # not joined to the one that was given up
            await settle()
            work.gate.release(2)
            assert [(await task).result for task in (running, patient, again)] == [0, 2, 4]
        assert work.batches == [[0], [1, 2]]

    run(test)


def test_work_that_nobody_waits_for_any_more_is_cancelled_and_frees_its_slot() -> None:
    async def test() -> None:
        cancelled: list[int] = []

        async def work(items: Sequence[int]) -> Sequence[int | PlannerError]:
            try:
                await asyncio.sleep(60 if items[0] < 0 else 0)
            except asyncio.CancelledError:
                cancelled.extend(items)
                raise
            return items

        async with Batcher(work, max_batch=1, max_wait=0, queue_size=8, abandons=True) as batcher:
            patient = submit(batcher, -1, key="a")
            await settle()
            with pytest.raises(DeadlineExceeded):
                await batcher.submit(-1, 0.01, key="a")
            assert not cancelled  # another still waits
            patient.cancel()
            assert (await batcher.submit(2, 30.0)).result == 2
            assert cancelled == [-1]

    run(test)


def test_several_batches_at_once_where_there_are_slots() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=1, slots=2) as batcher:
            tasks = [submit(batcher, item) for item in (1, 2, 3)]
            await work.wait_until_it_works()
            await work.wait_until_it_works()
            await settle()
            assert batcher.waiting == 1
            work.gate.release(3)
            await asyncio.gather(*tasks)
        assert sorted(work.batches) == [[1], [2], [3]]

    run(test)


def test_a_batch_refused_as_a_whole_tells_each() -> None:
    def work(items: Sequence[int]) -> Sequence[int]:
        raise Unavailable("away")

    async def test() -> None:
        async with batcher_of(work) as batcher:
            answers = await asyncio.gather(submit(batcher, 1), submit(batcher, 2), return_exceptions=True)
        assert [str(answer) for answer in answers] == ["away", "away"]

    run(test)


def test_stopping_before_a_batch_has_begun_refuses_it() -> None:
    async def test() -> None:
        batcher = batcher_of(list)
        async with batcher:
            task = submit(batcher, 1)
            while not batcher.waiting:
                await asyncio.sleep(0)
            await asyncio.sleep(0)  # the batch is formed now, and its work not yet begun
        with pytest.raises(Unavailable):
            await task

    run(test)
