"""Far more requests than the service can answer: some are answered, the others are told so at once."""

import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import httpx
import numpy as np

from thinknav_proto import (
    CONTENT_TYPE,
    DeadlineExceeded,
    Frame,
    Overloaded,
    SubgoalReply,
    SubgoalRequest,
    decode_replies,
    encode_requests,
)

StartService = Callable[..., tuple[str, "subprocess.Popen[str]"]]
HEADERS = {"Content-Type": CONTENT_TYPE}


def body(name: int, deadline: float = 60.0) -> bytes:
    frame = Frame.raw(np.full((4, 4, 3), name, np.uint8))
    return encode_requests([SubgoalRequest(request_id=str(name), goal="bed", frame=frame, deadline=deadline)])


def test_what_is_not_answered_is_refused_and_when_the_crowd_is_gone_all_is_well(start_service: StartService) -> None:
    url, _ = start_service("--latency", "0.3", "--max-batch", "4", "--queue-size", "4", "--cache-size", "0")

    with httpx.Client(trust_env=False, timeout=60, limits=httpx.Limits(max_connections=None)) as client:

        def ask(name: int) -> httpx.Response:
            return client.post(f"{url}/v1/subgoals", content=body(name), headers=HEADERS)

        with ThreadPoolExecutor(40) as crowd:
            responses = list(crowd.map(ask, range(40)))
        assert {response.status_code for response in responses} == {200, 429}
        refused = [response for response in responses if response.status_code == 429]
        assert len(refused) > 10
        for response in refused:
            assert int(response.headers["retry-after"]) >= 1
            (error,) = decode_replies(response.content)
            assert isinstance(error, Overloaded)
            assert 0 < error.retry_after < 10
        (answer,) = decode_replies(ask(100).content)
        assert isinstance(answer, SubgoalReply)
        assert answer.timings.queued < 0.3  # nothing of the crowd is left before it


def test_what_cannot_be_answered_in_time_is_not_queued(start_service: StartService) -> None:
    url, _ = start_service("--latency", "1.0", "--max-batch", "1", "--cache-size", "0")
    frames = [Frame.raw(np.full((4, 4, 3), name, np.uint8)) for name in range(8)]
    requests = [
        SubgoalRequest(request_id=str(name), goal="bed", frame=frame, deadline=2.5) for name, frame in enumerate(frames)
    ]
    with httpx.Client(trust_env=False, timeout=60) as client:
        client.post(f"{url}/v1/subgoals", content=body(100), headers=HEADERS)  # now it knows how long a batch takes
        response = client.post(f"{url}/v1/subgoals", content=encode_requests(requests), headers=HEADERS)
    answers = decode_replies(response.content)
    kinds = [type(answer) for answer in answers]
    assert kinds[0] is SubgoalReply
    assert kinds[3:] == 5 * [Overloaded]
    assert set(kinds[1:3]) <= {SubgoalReply, Overloaded, DeadlineExceeded}
