"""The planner's process is killed in mid-batch, again and again, while the real service is asked."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np
import pytest

from thinknav_proto import (
    CONTENT_TYPE,
    Frame,
    PlannerFailed,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
    decode_replies,
    encode_requests,
)

StartService = Callable[..., tuple[str, "subprocess.Popen[str]"]]

KILLS = 20
AT_ONCE = 8
IN_TIME_S = 60.0
FRAME = Frame.raw(np.zeros((4, 4, 3), np.uint8))


class Service:
    """The service whose planner says the number of its process, and notes what it begins to plan."""

    def __init__(self, client: httpx.Client, planned: Path) -> None:
        self._client = client
        self._planned = planned

    def ask(self, goal: str) -> tuple[int, object]:
        """The status, and the reply or error."""
        body = encode_requests([SubgoalRequest(request_id="1", goal=goal, frame=FRAME, deadline=2 * IN_TIME_S)])
        response = self._client.post("/v1/subgoals", content=body, headers={"Content-Type": CONTENT_TYPE})
        (answer,) = decode_replies(response.content)
        return response.status_code, answer

    def planner_pid(self) -> int:
        status, answer = self.ask("chair")
        assert status == 200
        assert isinstance(answer, SubgoalReply)
        return int(answer.subgoal.removeprefix("chair says "))

    def is_ready(self) -> bool:
        status = self._client.get("/readyz").status_code
        assert status in (200, 503)
        return status == 200

    def begun(self, goal: str) -> int:
        return self._planned.read_text().splitlines().count(goal)

    def restarts(self) -> int:
        page = self._client.get("/metrics").text
        (number,) = re.findall(r"^thinknav_planner_restarts ([\d.]+)", page, re.MULTILINE)
        return int(float(number))


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + IN_TIME_S
    while not true():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.01)


def children(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()


def test_a_planner_killed_in_mid_batch_twenty_times(
    start_service: StartService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [str(Path(__file__).parents[1] / "server"), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
    planned = tmp_path / "planned"
    url, process = start_service(
        *("--planner", "planners_for_tests:Naughty", "--argument", f"planned={planned}"),
        *("--max-batch", "4", "--cache-size", "0"),
    )
    pids, unready = set(), 0
    client = httpx.Client(base_url=url, trust_env=False, timeout=IN_TIME_S)
    with client, ThreadPoolExecutor(AT_ONCE) as clients:
        service = Service(client, planned)
        for kill in range(KILLS):
            pid = service.planner_pid()
            pids.add(pid)
            goals = [f"sleep {IN_TIME_S:g} {kill} {index}" for index in range(AT_ONCE)]
            asked = [clients.submit(service.ask, goal) for goal in goals]
            until(lambda goals=goals: any(map(service.begun, goals)))  # type: ignore[misc]
            os.kill(pid, signal.SIGKILL)
            answers = [future.result(IN_TIME_S) for future in asked]
            unready += not service.is_ready()
            for (status, answer), goal in zip(answers, goals, strict=True):
                assert service.begun(goal) <= 1, "nothing is planned twice"
                if isinstance(answer, Unavailable):  # it waited behind the batch
                    assert status == 503
                else:
                    assert isinstance(answer, PlannerFailed), repr(answer)
                    assert status == 502
                    assert "killed by SIGKILL" in str(answer)
            assert any(status == 502 for status, _ in answers)
            until(service.is_ready)
        pids.add(service.planner_pid())
        assert service.restarts() == KILLS
    assert len(pids) == KILLS + 1
    assert unready > KILLS // 2, "while it starts again, the service says that it is not ready"
    if Path(f"/proc/{process.pid}/task/{process.pid}/children").exists():
        assert len(children(process.pid)) == 1, "nothing is left of those that were killed"
