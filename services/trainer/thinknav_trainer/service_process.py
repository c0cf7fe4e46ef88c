"""A planning service of one's own, for as long as a block runs: `with planning_service() as url: …`.

It is the real server in its own process, on a loopback port that it chose. Knows only its command line.
"""

import logging
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from thinknav_trainer.errors import RunFailure

logger = logging.getLogger(__name__)

START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 10.0


class ServiceError(RunFailure):
    """The planning service could not be started; the message holds its last words."""


@contextmanager
def planning_service(log: Path, arguments: Sequence[str] = ("--planner", "embedded")) -> Iterator[str]:
    """Start `thinknav-server serve`, yield its URL, and stop it, whatever happens in the block.

    log: where its output goes. The service ends by itself when this process dies: it watches its standard input.
    Raises ServiceError.
    """
    with tempfile.TemporaryDirectory() as folder, log.open("wb") as output:
        announcement = Path(folder) / "url"
        command = [
            _server_command(),
            "serve",
            "--port",
            "0",
            "--announce",
            str(announcement),
            "--until-eof",
            *arguments,
        ]
        # A session of its own, so that Ctrl-C in the terminal reaches the trainer alone, which stops it in good order.
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            url = _wait_for(announcement, process, log)
            logger.info("the planning service is up at %s (its log: %s)", url, log)
            yield url
        finally:
            _stop(process)


def _server_command() -> str:
    """The server's script, beside this Python first."""
    beside = Path(sys.executable).with_name("thinknav-server")
    found = str(beside) if beside.exists() else shutil.which("thinknav-server")
    if found is None:
        raise ServiceError("thinknav-server is not installed here; pip install 'thinknav[server]'")
    return found


def _wait_for(announcement: Path, process: subprocess.Popen[bytes], log: Path) -> str:
    deadline = time.monotonic() + START_TIMEOUT_S
    while time.monotonic() < deadline:
        if announcement.exists():
            return announcement.read_text().strip()
        if process.poll() is not None:
            words = log.read_text(errors="replace").strip().splitlines()
            last = words[-1] if words else "it said nothing"
            raise ServiceError(f"the planning service ended with status {process.returncode}: {last}")
        time.sleep(0.05)
    raise ServiceError(f"the planning service was not up after {START_TIMEOUT_S:.0f} s; see {log}")


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        logger.warning("the planning service did not stop within %.0f s and is killed", STOP_TIMEOUT_S)
        process.kill()
        process.wait()
    if process.stdin is not None:
        process.stdin.close()
