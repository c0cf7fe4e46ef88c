"""A planner in a real process of its own: what it says comes back, and whatever it does, the service goes on."""

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import Frame, InvalidRequest, PlannerFailed, SubgoalRequest, Unavailable
from thinknav_server.hosts import PlannerProcess
from thinknav_server.hosts.process import ProcessSettings
from thinknav_server.hosts.wire import Kind
from thinknav_server.planners.options import PlannerOptions
from thinknav_server.thinking import Question, Thought


@pytest.fixture(autouse=True)
def _planners_can_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [str(Path(__file__).parent), *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))


def process_of(
    factory: str = "Naughty", limit: float = 30.0, load_limit: float = 60.0, **arguments: str
) -> PlannerProcess:
    options = PlannerOptions(planner=f"planners_for_tests:{factory}", arguments=arguments)
    return PlannerProcess(options, ProcessSettings(limit, load_limit))


def question(goal: str, data: bytes | None = None) -> Question:
    frame = Frame(encoding="jpeg", data=data) if data else Frame.raw(np.zeros((4, 4, 3), np.uint8))
    return Question(SubgoalRequest(request_id="1", goal=goal, frame=frame))


async def say(process: PlannerProcess, *goals: str) -> list[str]:
    thoughts = await process.think([question(goal) for goal in goals])
    return [thought.plan.instructions[0] for thought in thoughts if isinstance(thought, Thought)]


async def until_ready(process: PlannerProcess) -> None:
    async with asyncio.timeout(60):
        while not process.ready:
            await asyncio.sleep(0.01)


def run(process: PlannerProcess, test: Callable[[PlannerProcess], Coroutine[Any, Any, None]]) -> None:
    async def opened() -> None:
        async with asyncio.timeout(120), process:
            await test(process)

    asyncio.run(opened())
    with pytest.raises(ProcessLookupError):
        os.kill(process.pid, 0)


def test_it_answers_as_the_planner_does_and_fails_item_by_item() -> None:
    async def test(process: PlannerProcess) -> None:
        assert process.pid != os.getpid()
        assert process.identity.planner.name == "naughty"
        thoughts = await process.think(
            [question("chair"), question("raise"), question("sofa", b"\xff\xd8\xff no picture")]
        )
        good, choked, broken = thoughts
        assert isinstance(good, Thought)
        assert good.plan.instructions == (f"chair says {process.pid}",)
        np.testing.assert_array_equal(good.embedding, shipped_text_encoder().encode(good.plan.instructions)[0])
        assert good.planned > 0
        assert isinstance(choked, PlannerFailed)
        assert isinstance(broken, InvalidRequest)
        embeddings = await process.embed(["find a chair", "find a bed"])
        np.testing.assert_array_equal(embeddings, shipped_text_encoder().encode(["find a chair", "find a bed"]))

    run(process_of(), test)


def test_texts_are_embedded_while_a_batch_is_planned() -> None:
    async def test(process: PlannerProcess) -> None:
        planning = asyncio.create_task(say(process, "hang"))
        await asyncio.sleep(0)
        assert (await process.embed(["find a chair"])).shape == (1, 512)
        assert not planning.done()
        planning.cancel()

    run(process_of(), test)


@pytest.mark.parametrize(
    ("goal", "reason"),
    [("die", "ended .killed by SIGKILL."), ("exit", "ended .status 3."), ("hang", r"longer than its limit of 0\.3 s")],
)
def test_one_that_dies_or_hangs_is_started_again(goal: str, reason: str) -> None:
    async def test(process: PlannerProcess) -> None:
        first = process.pid
        with pytest.raises(PlannerFailed, match=reason):
            await process.think([question("chair"), question(goal)])
        assert not process.ready
        with pytest.raises(Unavailable, match="started again"):
            await say(process, "chair")
        with pytest.raises(Unavailable):
            await process.embed(["find a chair"])
        await until_ready(process)
        assert await say(process, "chair") == [f"chair says {process.pid}"]
        assert process.pid != first
        assert process.restarts == 1

    run(process_of(limit=0.3 if goal == "hang" else 30.0), test)


def test_a_batch_that_lay_ready_is_not_blamed_for_the_one_before() -> None:
    async def test(process: PlannerProcess) -> None:
        guilty, innocent = (asyncio.create_task(say(process, goal)) for goal in ("hang", "chair"))
        with pytest.raises(PlannerFailed, match="longer than its limit"):
            await guilty
        with pytest.raises(Unavailable, match="started again"):
            await innocent
        await until_ready(process)

    run(process_of(limit=0.3), test)


def test_a_batch_that_waits_for_another_has_its_whole_time() -> None:
    async def test(process: PlannerProcess) -> None:
        goals = ("sleep 0.4", "sleep 0.40", "sleep 0.400")
        assert len(await asyncio.gather(*(say(process, goal) for goal in goals))) == 3
        assert process.restarts == 0

    run(process_of(limit=1.0), test)


def test_a_batch_whose_decoding_breaks_fails_and_the_next_does_not() -> None:
    async def test(process: PlannerProcess) -> None:
        with process._ask(Kind.THINK, b"no requests") as broken:
            good = asyncio.create_task(say(process, "bed"))
            with pytest.raises(PlannerFailed, match="InvalidRequest"):
                await process._answer(broken)
        assert await good == [f"bed says {process.pid}"]

    run(process_of(), test)


def test_one_that_dies_idle_is_noticed() -> None:
    async def test(process: PlannerProcess) -> None:
        os.kill(process.pid, signal.SIGKILL)
        while not (process.restarts and process.ready):
            await asyncio.sleep(0.01)
        assert len(await say(process, "bed")) == 1

    run(process_of(), test)


def test_signals_meant_for_the_service_do_not_end_it() -> None:
    async def test(process: PlannerProcess) -> None:
        first = process.pid
        os.kill(first, signal.SIGTERM)
        os.kill(first, signal.SIGINT)
        assert await say(process, "bed") == [f"bed says {first}"]

    run(process_of(), test)


def test_starting_again_is_tried_until_it_works(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    obstacle, loads = tmp_path / "obstacle", tmp_path / "loads"

    async def test(process: PlannerProcess) -> None:
        obstacle.touch()
        with pytest.raises(PlannerFailed):
            await say(process, "die")
        while "cannot be started again" not in caplog.text:
            await asyncio.sleep(0.01)
        assert not process.ready
        obstacle.unlink()
        await until_ready(process)
        assert process.restarts == 1
        assert loads.read_text() == 2 * "loaded\n"

    run(process_of(fail_while=str(obstacle), loads=str(loads)), test)
    assert f"not while {obstacle} exists" in caplog.text


def test_starting_again_is_tried_where_the_machine_has_no_room_for_a_process(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def test(process: PlannerProcess) -> None:
        start, tries = subprocess.Popen, iter([True])

        def popen(*arguments: Any, **options: Any) -> Any:
            if next(tries, False):
                raise OSError(12, "Cannot allocate memory")
            return start(*arguments, **options)

        monkeypatch.setattr(subprocess, "Popen", popen)
        os.kill(process.pid, signal.SIGKILL)
        while not (process.restarts and process.ready):
            await asyncio.sleep(0.01)
        assert len(await say(process, "bed")) == 1

    run(process_of(), test)
    assert "Cannot allocate memory" in caplog.text


def test_texts_that_wait_for_others_have_their_whole_time(monkeypatch: pytest.MonkeyPatch) -> None:
    async def test(process: PlannerProcess) -> None:
        sent: list[Kind] = []
        ask = process._ask

        def noting(kind: Kind, body: bytes) -> Any:
            sent.append(kind)
            return ask(kind, body)

        monkeypatch.setattr(process, "_ask", noting)
        several = [asyncio.create_task(process.embed(["find a chair"] * 200)) for _ in range(3)]
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert sent == [Kind.EMBED]  # the others wait for it here, and their clocks do not run yet
        several[0].cancel()  # the process works on it all the same
        several[1].cancel()  # that is never sent
        await asyncio.sleep(0)
        assert sent == [Kind.EMBED]
        assert (await several[2]).shape == (200, 512)
        assert sent == [Kind.EMBED] * 2

    run(process_of(), test)


def test_it_ends_at_once_though_the_planner_hangs() -> None:
    async def test(process: PlannerProcess) -> None:
        planning = asyncio.create_task(say(process, "hang"))
        await asyncio.sleep(0.05)
        planning.cancel()

    began = time.monotonic()
    run(process_of(limit=600), test)
    assert time.monotonic() - began < 60


@pytest.mark.parametrize(
    ("factory", "message"),
    [
        ("refuses", "this planner never loads; choose another"),
        ("breaks", "RuntimeError: out of memory, say"),
        ("dies", r"ended while it loaded \(status 7\)"),
        ("absent", "cannot make the planner 'planners_for_tests:absent'"),
        ("hangs", r"not loaded within 2 s"),
    ],
)
def test_one_that_cannot_be_loaded_says_why(factory: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        process_of(factory, load_limit=2.0 if factory == "hangs" else 60.0)


def test_it_ends_with_the_service_whatever_it_is_doing(tmp_path: Path) -> None:
    program = """if True:
        import asyncio, sys, time
        sys.path.insert(0, sys.argv[1])
        from test_planner_process import process_of, question

        async def main():
            async with process_of() as process:
                planning = asyncio.create_task(process.think([question("hang")]))
                await asyncio.sleep(0.05)
                print(process.pid, flush=True)
                await planning

        asyncio.run(main())
    """
    command = [sys.executable, "-c", program, str(Path(__file__).parent)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as service:
        assert service.stdout
        pid = int(service.stdout.readline())
        service.kill()
    until = time.monotonic() + 30
    while _lives(pid):
        assert time.monotonic() < until
        time.sleep(0.01)


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False
