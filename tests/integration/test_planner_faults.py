"""The real service over a real planner process that hangs or dies, and a service that is told to stop meanwhile."""

import http.client
import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np
import pytest

from thinknav_proto import (
    CONTENT_TYPE,
    Frame,
    PlannerError,
    PlannerFailed,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
    decode_replies,
    encode_requests,
)

StartService = Callable[..., tuple[str, "subprocess.Popen[str]"]]
FAR = 60.0
KILLS = 20


@pytest.fixture(autouse=True)
def _planners_can_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    folder = str(Path(__file__).parents[1] / "server")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([folder, os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep))


@pytest.fixture
def client() -> Iterator[httpx.Client]:
    with httpx.Client(trust_env=False, timeout=FAR) as client:
        yield client


def naughty(start: StartService, *options: str) -> tuple[str, "subprocess.Popen[str]"]:
    return start("--planner", "planners_for_tests:Naughty", *options)


def ask(client: httpx.Client, url: str, *goals: str, deadline: float = 50.0) -> list[SubgoalReply | PlannerError]:
    frame = Frame.raw(np.zeros((4, 4, 3), np.uint8))
    requests = [
        SubgoalRequest(request_id=str(index), goal=goal, frame=frame, deadline=deadline)
        for index, goal in enumerate(goals)
    ]
    response = client.post(
        f"{url}/v1/subgoals", content=encode_requests(requests), headers={"Content-Type": CONTENT_TYPE}
    )
    return decode_replies(response.content)


def wait_for(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + FAR
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.01)


def is_ready(client: httpx.Client, url: str) -> bool:
    return client.get(f"{url}/readyz").status_code == 200


def queue_length(client: httpx.Client, url: str) -> float:
    (line,) = re.findall(r"^thinknav_queue_length (.*)", client.get(f"{url}/metrics").text, re.MULTILINE)
    return float(line)


def planner_pid(answer: SubgoalReply | PlannerError) -> int:
    assert isinstance(answer, SubgoalReply), answer
    return int(answer.subgoal.rpartition(" ")[2])


def gave_up(asked: "Future[list[SubgoalReply | PlannerError]]") -> bool:
    """Whether nothing but an error came of a body, be it that the connection was closed."""
    try:
        return all(isinstance(answer, PlannerError) for answer in asked.result())
    except (httpx.HTTPError, PlannerError):
        return True


def test_a_planner_killed_in_mid_batch_twenty_times(start_service: StartService, client: httpx.Client) -> None:
    url, service = naughty(start_service, "--max-batch", "2", "--cache-size", "0")
    for _ in range(KILLS):
        (answer,) = ask(client, url, "chair")
        with ThreadPoolExecutor(1) as asking:
            working = asking.submit(ask, client, url, "hang", "sofa", "bed", "tv")
            wait_for(lambda: "in_flight 4.0" in client.get(f"{url}/metrics").text)
            os.kill(planner_pid(answer), signal.SIGKILL)
            answers = working.result()
        assert [type(answer) for answer in answers] == [PlannerFailed, PlannerFailed, Unavailable, Unavailable]
        assert client.get(f"{url}/healthz").status_code == 200
        wait_for(lambda: is_ready(client, url))
    assert f"thinknav_planner_restarts {KILLS}.0" in client.get(f"{url}/metrics").text
    assert service.poll() is None


def test_a_planner_that_hangs_is_replaced_and_meanwhile_nobody_waits(
    start_service: StartService, client: httpx.Client
) -> None:
    url, _ = naughty(start_service, "--planner-limit", "0.3")
    (failed,) = ask(client, url, "hang")
    assert isinstance(failed, PlannerFailed)
    refused = client.get(f"{url}/readyz")
    assert (refused.status_code, refused.json()["error"]["code"]) == (503, "unavailable")
    (answer,) = ask(client, url, "chair")
    assert isinstance(answer, Unavailable)
    wait_for(lambda: is_ready(client, url))
    (answer,) = ask(client, url, "chair")
    assert planner_pid(answer) > 0


def test_a_hung_planner_does_not_hold_up_the_end(start_service: StartService, client: httpx.Client) -> None:
    url, service = naughty(start_service, "--grace", "0.2")
    (answer,) = ask(client, url, "chair")
    with ThreadPoolExecutor(1) as asking:
        working = asking.submit(ask, client, url, "hang")
        wait_for(lambda: "in_flight 1.0" in client.get(f"{url}/metrics").text)
        service.send_signal(signal.SIGTERM)
        assert service.wait(FAR) == 0
        assert gave_up(working)
    wait_for(lambda: not Path(f"/proc/{planner_pid(answer)}").exists())


def test_a_hung_planner_in_a_thread_does_not_hold_up_the_end_either(
    start_service: StartService, client: httpx.Client
) -> None:
    url, service = start_service("--latency", "600", "--grace", "0.2")
    with ThreadPoolExecutor(1) as asking:
        working = asking.submit(ask, client, url, "chair")
        wait_for(lambda: "in_flight 1.0" in client.get(f"{url}/metrics").text)
        service.send_signal(signal.SIGTERM)
        assert service.wait(FAR) == 0
        assert gave_up(working)


def test_told_to_stop_it_answers_what_it_has_and_refuses_what_is_new(
    start_service: StartService, client: httpx.Client
) -> None:
    url, service = naughty(start_service)
    waiting = http.client.HTTPConnection(url.removeprefix("http://"), timeout=FAR)
    waiting.request("GET", "/readyz")
    assert waiting.getresponse().read()
    with ThreadPoolExecutor(1) as asking:
        working = asking.submit(ask, client, url, "sleep 1.5")
        wait_for(lambda: "in_flight 1.0" in client.get(f"{url}/metrics").text)
        service.send_signal(signal.SIGTERM)
        wait_for(lambda: not is_ready(client, url))
        waiting.request("GET", "/readyz")
        assert waiting.getresponse().status == 503
        waiting.close()
        with httpx.Client(trust_env=False, timeout=FAR) as newcomer:
            (refused,) = ask(newcomer, url, "chair")
        assert isinstance(refused, Unavailable)
        (answer,) = working.result()
        assert isinstance(answer, SubgoalReply)
    assert service.wait(FAR) == 0


def test_a_client_that_sends_a_crowd_does_not_starve_one_that_sends_few(start_service: StartService) -> None:
    url, _ = naughty(start_service, "--max-batch", "2", "--queue-size", "64", "--cache-size", "0")
    finished: list[str] = []

    def crowd() -> None:
        with httpx.Client(trust_env=False, timeout=FAR) as greedy:
            ask(greedy, url, *(f"sleep 0.05{index:03d}" for index in range(64)))
        finished.append("greedy")

    asking = threading.Thread(target=crowd)
    asking.start()
    elsewhere = httpx.HTTPTransport(local_address="127.0.0.2")
    with httpx.Client(trust_env=False, timeout=FAR, transport=elsewhere) as modest:
        wait_for(lambda: queue_length(modest, url) > 20)
        answers = ask(modest, url, "sleep 0.01", "sleep 0.02")
        finished.append("modest")
    asking.join()
    assert [type(answer) for answer in answers] == 2 * [SubgoalReply]
    assert finished == ["modest", "greedy"]
