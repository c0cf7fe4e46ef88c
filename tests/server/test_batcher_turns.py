"""The batcher among clients: they take turns, and none has to suffer for another's requests."""

import asyncio
from collections.abc import Sequence

import pytest

from tests.server.gated_batches import GatedWork, batcher_of, run, settle, submit
from thinknav_proto import Overloaded
from thinknav_server.batcher import Batched


def test_a_client_that_asks_for_much_does_not_starve_the_others() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=2, queue_size=20) as batcher:
            greedy = [submit(batcher, item, client="greedy") for item in range(10)]
            await work.wait_until_it_works()
            modest = [submit(batcher, item, client="modest") for item in (100, 101)]
            await settle()
            work.gate.release(20)
            await asyncio.gather(*greedy, *modest)
        assert work.batches[:3] == [[0, 1], [2, 100], [3, 101]]

    run(test)


@pytest.mark.parametrize("queue_size", [256, 20_000])
def test_ten_requests_do_not_wait_behind_ten_thousand(queue_size: int) -> None:
    work = GatedWork()

    async def test() -> None:
        async with batcher_of(work, max_batch=4, queue_size=queue_size) as batcher:
            greedy = [submit(batcher, item, client="greedy") for item in range(10_000)]
            await work.wait_until_it_works()
            modest = [submit(batcher, item, client="modest") for item in range(10_000, 10_010)]
            await settle()
            work.gate.release(10_000)
            answers = await asyncio.gather(*modest)
            assert [answer.result for answer in answers] == [2 * item for item in range(10_000, 10_010)]
            for task in greedy:
                task.cancel()
            told = await asyncio.gather(*greedy, return_exceptions=True)
            assert {type(answer) for answer in told} <= {Batched, Overloaded, asyncio.CancelledError}

    run(test)
    ends = max(index for index, batch in enumerate(work.batches) if any(item >= 10_000 for item in batch))
    assert ends <= 5  # one was under way, and each of the next holds as many of theirs as of the other's


def test_a_full_queue_refuses_whoever_fills_it() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=1, queue_size=4) as batcher:
            running = submit(batcher, 0)
            await work.wait_until_it_works()
            greedy = [submit(batcher, item, client="greedy") for item in (1, 2, 3, 4)]
            await settle()
            modest = [submit(batcher, item, client="modest") for item in (5, 6)]
            await settle()
            with pytest.raises(Overloaded, match="full"):
                await batcher.submit(7, 30, "modest")  # who has his share
            with pytest.raises(Overloaded, match="full"):
                await batcher.submit(8, 30, "greedy")
            assert batcher.waiting == 4
            work.gate.release(9)
            answers = await asyncio.gather(running, *greedy, *modest, return_exceptions=True)
        assert [type(answer) for answer in answers] == [*3 * [Batched], *2 * [Overloaded], *2 * [Batched]]
        assert work.batches == [[0], [1], [5], [2], [6]]

    run(test)


@pytest.mark.parametrize(
    ("shared", "refused", "batches"),
    [((2,), {"greedy 1"}, [[0], [2], [8], [4]]), ((1, 2), {"newcomer"}, [[0], [1], [8], [2]])],
)
def test_a_full_queue_does_not_refuse_one_client_for_another(
    shared: Sequence[int], refused: set[str], batches: list[list[int]]
) -> None:
    """Who asks as one does that fills the queue has his answer all the same; who fills it loses the next newest."""

    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=1, queue_size=3) as batcher:
            tasks = {"running": submit(batcher, 0)}
            await work.wait_until_it_works()
            for item in (1, 2):
                tasks[f"greedy {item}"] = submit(batcher, item, client="greedy", key=f"{item}")
            tasks["modest"] = submit(batcher, 8, client="modest")
            await settle()
            for item in shared:
                tasks[f"alike {item}"] = submit(batcher, item, client="modest", key=f"{item}")
            await settle()
            tasks["newcomer"] = submit(batcher, 4, client="other")
            await settle()
            work.gate.release(9)
            answers = await asyncio.gather(*tasks.values(), return_exceptions=True)
        told = dict(zip(tasks, answers, strict=True))
        assert {name for name, answer in told.items() if isinstance(answer, Overloaded)} == refused
        assert sum(isinstance(answer, Batched) for answer in answers) == len(tasks) - 1
        assert work.batches == batches

    run(test)


def test_who_asks_what_another_asks_far_back_does_not_wait_behind_all_of_it() -> None:
    async def test() -> None:
        work = GatedWork()
        async with batcher_of(work, max_batch=1, queue_size=9) as batcher:
            running = submit(batcher, 0)
            await work.wait_until_it_works()
            greedy = [submit(batcher, item, client="greedy", key=f"{item}") for item in (1, 2, 3, 4)]
            await settle()
            alike = submit(batcher, 4, client="modest", key="4")
            await settle()
            late = submit(batcher, 1, client="modest", key="1")  # whose turn comes first as it is
            await settle()
            work.gate.release(9)
            answers = await asyncio.gather(running, *greedy, alike, late)
        assert [answer.result for answer in answers] == [0, 2, 4, 6, 8, 8, 2]
        assert work.batches == [[0], [1], [4], [2], [3]]

    run(test)
