"""Real processes for tests that cross them."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 30.0

StartService = Callable[..., tuple[str, "subprocess.Popen[str]"]]


def wait_for_url(announced: Path, process: "subprocess.Popen[str]") -> str:
    """The URL that the service announces once it accepts requests."""
    until = time.monotonic() + START_TIMEOUT_S
    while not announced.exists():
        if process.poll() is not None:
            raise RuntimeError(f"the service ended with {process.returncode}: {process.communicate()[1]}")
        if time.monotonic() > until:
            raise RuntimeError(f"the service did not start within {START_TIMEOUT_S:g} s")
        time.sleep(0.02)
    return announced.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def start_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StartService]:
    """Starts `thinknav-server serve`, scripted unless the options name a planner; gives its URL and process. All are
    ended with the tests.

    prefix: a command that the service is run by, such as `ip netns exec`.
    """
    processes: list[subprocess.Popen[str]] = []
    folder = tmp_path_factory.mktemp("services")

    def start(*options: str, prefix: Sequence[str] = ()) -> tuple[str, "subprocess.Popen[str]"]:
        announced = folder / f"url-{len(processes)}"
        command = [*prefix, str(Path(sys.executable).with_name("thinknav-server")), "serve", "--port", "0"]
        command += ["--planner", "scripted"]  # unless the options say otherwise: the last one counts
        command += ["--log-level", "warning"]  # a line for each request would fill the pipe, which nobody empties
        process = subprocess.Popen(
            [*command, "--announce", str(announced), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return wait_for_url(announced, process), process

    yield start
    for process in processes:
        if process.poll() is None:
            process.terminate()
        try:
            process.communicate(timeout=STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@pytest.fixture(scope="session")
def planning_service(start_service: StartService) -> str:
    """The URL of a planning service in a process of its own, with the scripted planner; shared by all tests."""
    url, _ = start_service("--planner", "scripted")
    return url
