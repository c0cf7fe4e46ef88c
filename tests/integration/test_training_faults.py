"""Training against the real service while that is killed, slow, or replaced by something else: nothing miscounted.

THINKNAV_RESTARTS sets how often it is killed and started again; the default is kept small.
"""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from tests.integration.conftest import wait_for_url
from thinknav_proto import CONTENT_TYPE, PlannerError, SubgoalRequest
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import load_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import Answer, HttpTransport, PlannerClient
from thinknav_trainer.run import Run, list_checkpoints, read_metrics
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.train import train

RESTARTS = int(os.environ.get("THINKNAV_RESTARTS", "2"))
TIMEOUT_S = 300.0
OVERRIDES = ("deterministic=false", "total_steps=100000000", "policy.think_bias=1", "think.patience=600")
SERVER = "from thinknav_server.cli import main; main()"
ANOTHER_SPACE = (
    "from thinknav_models import EmbeddingSpace; from thinknav_models.clip import ClipTextEncoder; "
    "ClipTextEncoder.space = property(lambda self: EmbeddingSpace('another', '1')); " + SERVER
)


class CountingTransport(HttpTransport):
    """Counts the requests that it was given."""

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self.sent = 0
        self._lock = threading.Lock()

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[Answer]:
        with self._lock:
            self.sent += len(requests)
        return super().ask(requests)


@pytest.fixture(scope="module")
def homes() -> Homes:
    return make_homes(load_config("smoke"))


@contextmanager
def service(folder: Path, port: int = 0, code: str = SERVER, *options: str) -> Iterator[tuple[str, int]]:
    """The real server in its own process, on a port that may be one that another had: its URL and port. Then killed."""
    announced = folder / f"url-{time.monotonic_ns()}"
    command = [
        sys.executable,
        "-c",
        code,
        "serve",
        "--planner",
        "scripted",
        "--port",
        str(port),
        "--announce",
        str(announced),
        *options,
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        url = wait_for_url(announced, process)
        yield url, int(url.rsplit(":", 1)[1])
    finally:
        process.kill()
        process.communicate()


class Training:
    """A run in a thread of its own, until `end`."""

    def __init__(self, folder: Path, homes: Homes, url: str, *overrides: str) -> None:
        self.folder = folder
        self.transport = CountingTransport(url)
        self.interruption = Interruption()
        self.error: PlannerError | None = None
        self._client = PlannerClient(self.transport)
        self._run = Run.create(folder, load_config("smoke", overrides=[*OVERRIDES, *overrides]))
        self._thread = threading.Thread(target=self._train, args=(homes,))
        self._thread.start()

    def _train(self, homes: Homes) -> None:
        try:
            train(self._run, homes, self._client, self.interruption)
        except PlannerError as error:
            self.error = error
        finally:
            self._run.close()

    def last(self, name: str) -> float:
        """A metric of the last update; 0 before the first."""
        rows = read_metrics(self.folder)
        return rows[-1][f"thoughts/{name}"] if rows else 0.0

    def codes(self) -> list[str | None]:
        """Of each thought so far the code of its error, none where there was a reply."""
        path = self.folder / "thoughts.jsonl"
        whole = path.read_text().splitlines(keepends=True) if path.exists() else []
        thoughts = [json.loads(line) for line in whole if line.endswith("\n")]
        return [None if "error" not in thought else str(thought["error"]["code"]) for thought in thoughts]

    def wait_for(self, condition: Callable[[], bool]) -> None:
        until = time.monotonic() + TIMEOUT_S
        while not condition():
            assert self._thread.is_alive(), self.error
            assert time.monotonic() < until
            time.sleep(0.02)

    def wait_for_more(self, name: str) -> None:
        """Until another thought was answered, or failed."""
        before = self.last(name)
        self.wait_for(lambda: self.last(name) > before)

    def end(self) -> None:
        """Stop it, and hold what it counted against what was sent."""
        self.interruption.request(2)
        self.join()
        assert self.error is None
        last = Checkpoint.load(list_checkpoints(self.folder)[-1])
        env = last.state["collector"]["env"]
        done = env["counts"]["answered"] + env["counts"]["failed"]
        until = time.monotonic() + TIMEOUT_S
        while self.transport.sent < done + len(env["parked"]) and time.monotonic() < until:
            time.sleep(0.02)  # those that are parked may be on their way to the transport still
        assert self.transport.sent == done + len(env["parked"])
        thoughts = [json.loads(line) for line in (self.folder / "thoughts.jsonl").read_text().splitlines()]
        assert len(thoughts) == done
        assert sum(thought["subgoal"] is not None for thought in thoughts) == env["counts"]["answered"]
        self._client.close()

    def join(self) -> None:
        self._thread.join(TIMEOUT_S)
        assert not self._thread.is_alive()


def test_a_service_that_is_killed_and_started_again(tmp_path: Path, homes: Homes) -> None:
    with service(tmp_path) as (url, port):
        training = Training(tmp_path / "run", homes, url)
        training.wait_for_more("answered")
    for _ in range(RESTARTS):
        training.wait_for_more("failed")
        with service(tmp_path, port):
            training.wait_for_more("answered")
    training.end()


def test_a_service_slower_than_the_deadline(tmp_path: Path, homes: Homes) -> None:
    with service(tmp_path, 0, SERVER, "--latency", "0.5") as (url, _):
        training = Training(tmp_path / "run", homes, url, "think.deadline=0.05")
        training.wait_for_more("failed")
        training.end()
    codes = {json.loads(line)["error"]["code"] for line in (tmp_path / "run/thoughts.jsonl").read_text().splitlines()}
    assert codes == {"deadline_exceeded"}


def test_garbage_in_the_place_of_a_service(tmp_path: Path, homes: Homes) -> None:
    class Garbage(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            body = os.urandom(100)
            self.send_response(200)
            self.send_header("Content-Type", CONTENT_TYPE)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            """Nothing."""

    with service(tmp_path) as (url, port):
        training = Training(tmp_path / "run", homes, url)
        training.wait_for_more("answered")
    garbage = HTTPServer(("127.0.0.1", port), Garbage)
    thread = threading.Thread(target=garbage.serve_forever)
    thread.start()
    try:
        training.wait_for_more("failed")
        training.wait_for_more("failed")
        training.end()
    finally:
        garbage.shutdown()
        thread.join()
        garbage.server_close()


def test_another_embedding_space_is_refused(tmp_path: Path, homes: Homes) -> None:
    """Each reply is a failure, by name; a run without patience for those ends as it does for any other."""
    with service(tmp_path) as (url, port):
        training = Training(tmp_path / "run", homes, url)
        training.wait_for_more("answered")
    with service(tmp_path, port, ANOTHER_SPACE):
        training.wait_for(lambda: "protocol_mismatch" in training.codes())
        training.wait_for_more("failed")
        training.end()
    codes = training.codes()
    since = codes[codes.index("protocol_mismatch") :]
    assert None not in since
    assert "now embeds in another@1, not in thinknav-clip@" in (tmp_path / "run/thoughts.jsonl").read_text()
    embedded = [json.loads(line) for line in (tmp_path / "run/embeddings.jsonl").read_text().splitlines()]
    texts = [line["text"] for line in embedded if line["text"]]
    assert len(set(texts)) == len(texts)  # of one space alone: a text that was embedded twice would show
