"""The ledger of an experiment: a JSON line for each job that is done, kept in small files that survive a fresh clone.

A job whose (arm, seed, digest) has a line is not done again, wherever its run lies, or lay.
"""

import functools
import json
import os
import subprocess
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from thinknav_trainer.config import ConfigError
from thinknav_trainer.experiments.job import Job

Line = dict[str, Any]


class Ledger:
    """`NAME.runs.jsonl` in a folder. One process at a time may add to it. Raises ConfigError for what is no line."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder = folder
        self.name = name
        self.path = folder / f"{name}.runs.jsonl"
        self._lines: dict[tuple[str, int, str], Line] = {}
        for number, text in enumerate(_texts(self.path), 1):
            try:
                line = json.loads(text)
                self._lines[line["arm"], line["seed"], line["digest"]] = line
            except (json.JSONDecodeError, KeyError, TypeError) as error:
                raise ConfigError(f"{self.path}, line {number} is no line of a ledger ({error})") from None

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def most_seeds(self) -> int | None:
        """How many seeds an arm has at most, if there is any line: those from 0 to the highest."""
        return max((seed + 1 for _, seed, _ in self._lines), default=None)

    def find(self, job: Job) -> Line | None:
        """The line of a job, if it is done."""
        return self._lines.get(job.key)

    def lines_of(self, jobs: Iterable[Job]) -> list[Line]:
        """Those of these jobs that are done, in their order."""
        return [line for job in jobs if (line := self.find(job)) is not None]

    def add(self, line: Line) -> None:
        """A job is done. The line is on the disk when this returns."""
        self.folder.mkdir(parents=True, exist_ok=True)
        whole = not self.path.exists() or self.path.read_bytes()[-1:] in (b"", b"\n")
        with self.path.open("a") as file:
            file.write(("" if whole else "\n") + json.dumps(line, separators=(",", ":"), allow_nan=False) + "\n")
            file.flush()
            os.fsync(file.fileno())
        self._lines[line["arm"], line["seed"], line["digest"]] = line


def _texts(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines() if path.exists() else []
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path} is no ledger: {error}") from None


@functools.cache
def whose_code() -> dict[str, str | None]:
    """ThinkNav's version, and the commit where it runs from a repository."""
    describe = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        done = subprocess.run(describe, capture_output=True, text=True, check=False, timeout=10)
        commit = done.stdout.strip() or None
    except (OSError, subprocess.TimeoutExpired):
        commit = None
    return {"version": version("thinknav"), "commit": commit}
