"""The real `thinknav-server` in a process of its own, asked by the real client over a socket."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_models.clip import shipped_text_encoder
from thinknav_trainer.planner import (
    DeadlineExceeded,
    Frame,
    InvalidRequest,
    Overloaded,
    PlannerError,
    PlannerFailed,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
    connect,
    encode_frame,
)

StartService = Callable[..., tuple[str, "subprocess.Popen[str]"]]
STOP_TIMEOUT_S = 30.0


def picture(seed: int) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (64, 64, 3), dtype=np.uint8)


def request(name: str, frame: Frame, deadline: float = 30.0) -> SubgoalRequest:
    return SubgoalRequest(request_id=name, goal="chair", frame=frame, deadline=deadline)


def test_subgoals_for_many_frames(planning_service: str) -> None:
    with connect(planning_service) as planner:
        asked = [request(str(seed), encode_frame(picture(seed), "raw")) for seed in range(40)]
        asked += [request(str(seed), encode_frame(picture(seed))) for seed in range(40, 80)]
        answers = planner.ask(asked)
        replies = [answer for answer in answers if isinstance(answer, SubgoalReply)]
        assert [reply.request_id for reply in replies] == [str(seed) for seed in range(80)]
        assert len({reply.subgoal for reply in replies}) > 3
        expected = shipped_text_encoder().encode([reply.subgoal for reply in replies])
        np.testing.assert_array_equal(np.stack([reply.embedding for reply in replies]), expected)
        again = planner.ask(asked)
        assert [r.subgoal for r in again if isinstance(r, SubgoalReply)] == [r.subgoal for r in replies]
        assert planner.counts.answered == planner.counts.asked == 160
        assert planner.info.identity == replies[0].planner
        assert planner.info.planner == "scripted"


def test_texts_are_embedded_in_the_announced_space(planning_service: str) -> None:
    texts = [f"find a chair, attempt {index}" for index in range(1500)]
    with connect(planning_service) as planner:
        assert planner.info.embedding_space == str(shipped_text_encoder().space)
        np.testing.assert_array_equal(planner.embed(texts), shipped_text_encoder().encode(texts))
        with pytest.raises(InvalidRequest, match="characters, the limit is"):
            planner.embed(["long " * 1000])


def test_one_bad_frame_fails_alone(planning_service: str) -> None:
    with connect(planning_service) as planner:
        good = encode_frame(picture(0))
        broken = Frame(encoding="jpeg", data=good.data[:100])
        answers = planner.ask([request("0", good), request("1", broken), request("2", good)])
    assert [type(answer) for answer in answers] == [SubgoalReply, InvalidRequest, SubgoalReply]


def test_a_failing_planner_fails_its_share(start_service: StartService) -> None:
    url, _ = start_service("--failure-rate", "0.5", "--seed", "3")
    with connect(url) as planner:
        answers = planner.ask([request(str(seed), encode_frame(picture(seed))) for seed in range(40)])
    failures = [answer for answer in answers if isinstance(answer, PlannerFailed)]
    assert 8 < len(failures) < 32
    assert len(failures) + sum(isinstance(answer, SubgoalReply) for answer in answers) == 40


def test_over_its_limit_it_refuses_what_it_has_no_place_for(start_service: StartService) -> None:
    url, _ = start_service("--latency", "1.0", "--max-batch", "1", "--queue-size", "1")
    with connect(url) as planner:
        answers = planner.ask([request(str(index), encode_frame(picture(index))) for index in range(5)])
    assert [type(answer) for answer in answers] == [SubgoalReply] + 4 * [Overloaded]

    def post(index: int) -> httpx.Response:
        files = {"frame": ("a.jpg", encode_frame(picture(10 + index)).data)}
        return httpx.post(f"{url}/v1/subgoals", data={"goal": "bed"}, files=files, trust_env=False, timeout=30)

    with ThreadPoolExecutor(6) as clients:
        responses = list(clients.map(post, range(6)))
    assert {response.status_code for response in responses} == {200, 429}
    refused = next(response for response in responses if response.status_code == 429)
    assert int(refused.headers["retry-after"]) >= 1
    assert refused.json()["replies"][0]["error"]["code"] == "overloaded"


def test_a_deadline_holds_and_a_client_that_leaves_is_forgotten(start_service: StartService) -> None:
    url, _ = start_service("--latency", "0.5", "--max-batch", "1", "--queue-size", "2")
    frame = encode_frame(picture(0))
    with connect(url) as planner:
        (late,) = planner.ask([request("0", frame, deadline=0.05)])
        assert isinstance(late, DeadlineExceeded)
        for _ in range(4):  # each leaves a place in a queue of 2
            with pytest.raises(httpx.ReadTimeout):
                httpx.post(
                    f"{url}/v1/subgoals",
                    data={"goal": "bed"},
                    files={"frame": ("a.jpg", frame.data)},
                    trust_env=False,
                    timeout=httpx.Timeout(10, read=0.05),
                )
        (answer,) = planner.ask([request("1", frame)])
        assert isinstance(answer, SubgoalReply)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_stops_it_gracefully(start_service: StartService, tmp_path: Path, number: signal.Signals) -> None:
    url, process = start_service("--latency", "0.5")
    with connect(url) as planner:
        answers: list[SubgoalReply | PlannerError] = []
        asked = request("0", encode_frame(picture(0)))
        asking = threading.Thread(target=lambda: answers.extend(planner.ask([asked])))
        asking.start()
        time.sleep(0.2)  # so that the request is in progress, whose answer must still come
        process.send_signal(number)
        output, log = process.communicate(timeout=STOP_TIMEOUT_S)
        asking.join()
        assert process.returncode == 0
        assert isinstance(answers[0], SubgoalReply)
        assert output.splitlines() == [f"serving planner {planner.info.identity} at {url}"]
        assert "Traceback" not in log
        (gone,) = planner.ask([asked])
    assert isinstance(gone, Unavailable)
    with pytest.raises(Unavailable, match=f"no planning service at {url} .* thinknav-server serve --port 8765"):
        connect(url)


def test_while_it_stops_what_is_asked_is_answered_and_what_comes_is_refused(start_service: StartService) -> None:
    url, process = start_service("--latency", "8", "--max-batch", "1", "--grace", "60")
    with httpx.Client(trust_env=False, timeout=60) as client, ThreadPoolExecutor(1) as asking:

        def post(index: int) -> httpx.Response:
            files = {"frame": ("a.jpg", encode_frame(picture(index)).data)}
            return client.post(f"{url}/v1/subgoals", data={"goal": "bed"}, files=files)

        asked = asking.submit(post, 0)
        while "\nthinknav_in_flight 1.0\n" not in client.get(f"{url}/metrics").text:
            assert not asked.done()
        process.send_signal(signal.SIGTERM)
        until = time.monotonic() + STOP_TIMEOUT_S
        while client.get(f"{url}/readyz").status_code == 200:
            assert time.monotonic() < until
        assert client.get(f"{url}/healthz").status_code == 200
        refused = post(1)
        assert not asked.done()
        assert refused.status_code == 503
        assert refused.json()["replies"][0]["error"]["message"] == "the service is stopping"
        assert asked.result(STOP_TIMEOUT_S).status_code == 200
    process.communicate(timeout=STOP_TIMEOUT_S)
    assert process.returncode == 0


def serve(*options: str) -> "subprocess.CompletedProcess[str]":
    command = [str(Path(sys.executable).with_name("thinknav-server")), "serve", "--planner", "scripted", *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_a_port_in_use_is_one_clear_line(planning_service: str) -> None:
    port = planning_service.rpartition(":")[2]
    ended = serve("--port", port)
    assert ended.returncode == 1
    assert ended.stderr == (
        f"thinknav-server: cannot listen on 127.0.0.1 port {port}: Address already in use; "
        "try others by --host and --port\n"
    )


def test_a_wrong_script_is_one_clear_line(tmp_path: Path) -> None:
    path = tmp_path / "script.yaml"
    path.write_text("default: []\n")
    ended = serve("--port", "0", "--script", str(path))
    assert ended.returncode == 1
    assert ended.stderr.startswith(f"thinknav-server: the script {path} is wrong: default")
    assert ended.stderr.count("\n") == 1
