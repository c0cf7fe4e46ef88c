"""A queue in which clients take turns: whoever asks for much waits behind his own requests, not others behind him.

Knows nothing of time or of what is queued; every operation but `crowd`, `ahead_of` and `place` takes constant time.
"""

from collections.abc import Iterator
from typing import Generic, TypeVar

Job = TypeVar("Job")


class FairQueue(Generic[Job]):
    """First come, first served within a client, one after the other among clients. A job can leave at any time."""

    def __init__(self) -> None:
        self._lines: dict[str, dict[Job, None]] = {}  # the client whose turn is next comes first
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def add(self, client: str, job: Job) -> None:
        """A job to the end of its client's line."""
        self._lines.setdefault(client, {})[job] = None
        self._length += 1

    def discard(self, client: str, job: Job) -> None:
        """Takes out a job, if it still waits."""
        line = self._lines.get(client, {})
        if job in line:
            self._remove(client, line, job)

    def take(self, count: int) -> list[Job]:
        """At most `count` jobs, in the order of turns."""
        taken: list[Job] = []
        while self._lines and len(taken) < count:
            client = next(iter(self._lines))
            line = self._lines.pop(client)
            job = next(iter(line))
            if len(line) > 1:
                self._lines[client] = line  # behind all others
            self._remove(client, line, job)
            taken.append(job)
        return taken

    def first_in_line(self) -> Iterator[Job]:
        """The job of each client that has waited longest."""
        return (next(iter(line)) for line in self._lines.values())

    def waiting(self, client: str) -> int:
        """Jobs of one client."""
        return len(self._lines.get(client, ()))

    def ahead_of(self, client: str) -> int:
        """Jobs that would be taken before one more of this client's."""
        own = self.waiting(client)
        return own + sum(min(len(line), own + 1) for name, line in self._lines.items() if name != client)

    def place(self, client: str, job: Job) -> int | None:
        """How many jobs of its client's stand before a job, None where it does not wait."""
        return next((place for place, other in enumerate(self._lines.get(client, ())) if other is job), None)

    def crowd(self) -> tuple[str, int]:
        """The client with most jobs, and their number; the queue must not be empty."""
        client = max(self._lines, key=lambda name: len(self._lines[name]))
        return client, len(self._lines[client])

    def newest(self, client: str) -> Iterator[Job]:
        """The jobs of one client, the newest first."""
        return reversed(self._lines.get(client, {}))

    def clear(self) -> list[Job]:
        """Takes out all jobs."""
        return self.take(self._length)

    def _remove(self, client: str, line: dict[Job, None], job: Job) -> None:
        del line[job]
        if not line:
            self._lines.pop(client, None)
        self._length -= 1
