"""MiniWorld as a peer, in a process and a virtual environment of its own: its versions are not ours."""

import json
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Self

from thinknav_trainer.bench.figures import Timing

HOW_TO_INSTALL = "MiniWorld is not installed: make bench-peers"
_SCRIPT = Path(__file__).with_name("miniworld_peer.py")


class PeerMissing(RuntimeError):
    """The peer is not installed, or does not run here; the message says what to do."""


class MiniWorld:
    """A running MiniWorld that draws on request. Raises PeerMissing."""

    def __init__(self, peers: Path, size: int) -> None:
        python = peers / "bin" / "python"
        if not python.exists():
            raise PeerMissing(HOW_TO_INSTALL)
        self._process = subprocess.Popen(
            [str(python), "-I", str(_SCRIPT), str(size)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        if self._answer() != "ready":
            *_, reason = ["no message", *self._process.communicate()[1].strip().splitlines()]
            raise PeerMissing(
                f"MiniWorld does not run here ({reason}); it needs libegl1, libgl1-mesa-dri and libglu1-mesa"
            )

    def draw(self, frames: int) -> Timing:
        """Take that many steps, with RGB and depth of each."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{frames}\n")
        self._process.stdin.flush()
        return Timing(**json.loads(self._answer()))

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
