"""Starts the service, or its peer, in a process of its own over the emulated model, and makes requests for each."""

import base64
import json
import logging
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import simplejpeg
from PIL import Image

from thinknav_proto import CONTENT_TYPE, Frame, SubgoalRequest, encode_requests
from thinknav_server.bench.load import http_request

logger = logging.getLogger(__name__)

_START_S = 120.0
_FRAMES = 512  # more than are asked at once, so that none is asked twice at a time


@dataclass(frozen=True)
class Setup:
    """base, item: the model's milliseconds. The rest is as the service's options of these names.

    cache_size: of the service alone; its peer has no cache.
    """

    base: float
    item: float
    max_batch: int = 32
    max_wait: float = 0.005
    queue_size: int = 256
    cache_size: int = 0


@contextmanager
def our_service(setup: Setup, *options: str, quiet: bool = False) -> Iterator[tuple[str, int]]:
    """The service over the emulated model, with more options if need be: its URL and the number of its process.

    quiet: without its log.
    """
    command = ["--planner", "thinknav_server.bench.planner:EmulatedPlanner", "--log-level", "warning"]
    command += ["--argument", f"base={setup.base}", "--argument", f"item={setup.item}"]
    command += ["--max-batch", str(setup.max_batch), "--max-wait", str(setup.max_wait)]
    command += ["--queue-size", str(setup.queue_size), "--cache-size", str(setup.cache_size), *options]
    with service_with(command, quiet) as served:
        yield served


@contextmanager
def service_with(options: Sequence[str], quiet: bool = False, patience: float = _START_S) -> Iterator[tuple[str, int]]:
    """The service with options of `serve`: its URL and the number of its process. patience: seconds for its start."""
    with tempfile.TemporaryDirectory() as folder:
        announced = Path(folder) / "url"
        command = [sys.executable, "-m", "thinknav_server", "serve", "--port", "0", "--announce", str(announced)]
        command += [*options, "--until-eof"]  # it ends with us, even if we are killed
        with _running(command, quiet) as process:
            _wait(process, announced.exists, patience)
            yield announced.read_text(encoding="utf-8"), process.pid


@contextmanager
def litserve(python: Path, setup: Setup) -> Iterator[tuple[str, int]]:
    """LitServe in its own virtual environment: its URL and the number of its process."""
    port = free_port()
    script = Path(__file__).with_name("litserve_peer.py")
    numbers = (port, setup.base, setup.item, setup.max_batch, setup.max_wait)
    with _running([str(python), str(script), *map(str, numbers)]) as process:
        url = f"http://127.0.0.1:{port}"
        _wait(process, lambda: _is_healthy(url))
        yield url, process.pid


@contextmanager
def frozen(pid: int) -> Iterator[None]:
    """A server, with the processes that it started, takes no processor time meanwhile."""
    os.killpg(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.killpg(pid, signal.SIGCONT)


def free_port() -> int:
    """One that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def jpegs() -> list[bytes]:
    """Pictures of 256 x 256, all different, 11 KB each: as many as views of our homes have on average."""
    random = np.random.default_rng(0)
    coarse = random.integers(0, 256, (_FRAMES, 5, 5, 3), dtype=np.uint8)
    large = (np.asarray(Image.fromarray(image).resize((256, 256), Image.Resampling.BICUBIC)) for image in coarse)
    return [simplejpeg.encode_jpeg(np.ascontiguousarray(image), quality=90) for image in large]


def our_requests(url: str, frames: list[bytes]) -> list[bytes]:
    """One frame each, over HTTP."""
    return [http_request(url, "/v1/subgoals", CONTENT_TYPE, body) for body in our_bodies(frames)]


def our_bodies(frames: list[bytes]) -> list[bytes]:
    """One frame each, as the contract has it."""
    requests = (
        SubgoalRequest(request_id=str(index), goal="chair", frame=Frame(encoding="jpeg", data=data))
        for index, data in enumerate(frames)
    )
    return [encode_requests([request]) for request in requests]


def litserve_requests(url: str, frames: list[bytes]) -> list[bytes]:
    """One frame each, as LitServe's guide has it."""
    bodies = (json.dumps({"goal": "chair", "frame": base64.b64encode(data).decode()}).encode() for data in frames)
    return [http_request(url, "/predict", "application/json", body) for body in bodies]


def check_each_was_planned(url: str) -> None:
    """Raises RuntimeError when our service has answered any request without asking its planner."""
    with urlopen(f"{url}/metrics", timeout=10.0) as answer:
        page = answer.read().decode()
    saved = [
        line for line in page.splitlines() if line.startswith("thinknav_saved_total") and not line.endswith(" 0.0")
    ]
    if saved:
        raise RuntimeError(f"the planner was not asked for all that was answered: {', '.join(saved)}")


@contextmanager
def _running(command: list[str], quiet: bool = False) -> Iterator["subprocess.Popen[bytes]"]:
    # A session of its own, so that its workers end with it: LitServe's outlive a server that is killed.
    log = subprocess.DEVNULL if quiet else None
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log, start_new_session=True
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(15)
        except subprocess.TimeoutExpired:
            logger.warning("the server to measure did not stop when told to")
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def _wait(process: "subprocess.Popen[bytes]", ready: Callable[[], bool], patience: float = _START_S) -> None:
    until = time.monotonic() + patience
    while not ready():
        if process.poll() is not None:
            raise RuntimeError(f"the server to measure ended with status {process.returncode}")
        if time.monotonic() > until:
            raise RuntimeError(f"the server to measure was not up within {patience:g} s")
        time.sleep(0.05)


def _is_healthy(url: str) -> bool:
    """Whether LitServe's workers are up, which come after its port."""
    try:
        with urlopen(f"{url}/health", timeout=1.0) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False
