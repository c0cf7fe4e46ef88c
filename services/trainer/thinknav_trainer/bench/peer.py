"""A peer to compare with: a process in a virtual environment of its own, which works when it is told to.

It says "ready" once it is. Each line that it is sent is an amount of work, and each of its answers a line of JSON.
"""

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self


class PeerMissing(RuntimeError):
    """The peer is not installed, or does not run here; the message says what to do."""


class Peer:
    """A running peer. Raises PeerMissing."""

    def __init__(self, name: str, peers: Path, arguments: Sequence[str], needs: str = "") -> None:
        """peers: the virtual environment. arguments: of its Python. needs: what else it takes, if it does not start."""
        python = peers / "bin" / "python"
        if not python.exists():
            raise PeerMissing(f"{name} is not installed: make bench-peers")
        self._process = subprocess.Popen(
            [str(python), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        if self._answer() != "ready":
            *_, reason = ["no message", *self._process.communicate()[1].strip().splitlines()]
            raise PeerMissing(f"{name} does not run here ({reason})" + (f"; it needs {needs}" if needs else ""))

    def work(self, amount: int) -> dict[str, Any]:
        """Do so much, and what came of it."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{amount}\n")
        self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._answer())
        return answer

    def _answer(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.communicate()
