"""What a balancer knows of one replica: what it is asked now, and whether it may be asked more.

A replica begins unknown, serves once it has said who it is, and is out from its failure until it has said so again.
Knows nothing of the other replicas. Not thread-safe: the balancer holds its lock.
"""

from concurrent.futures import Future
from enum import Enum, auto

from thinknav_proto import PlannerError
from thinknav_trainer.planner.link import Link

# Seconds until a replica that was put out is looked at again; twice as many each time, up to the longest.
FIRST_RETRY_S = 0.25
LONGEST_RETRY_S = 5.0
# A replica that has kept somebody waiting for so long, in seconds, is asked whether it lives, and this often.
SUSPECT_S = 1.0
# Seconds for it to say so.
PROBE_S = 2.0
# Bodies in a row to which a replica gave errors alone before it is put out.
FAILURES = 5


class State(Enum):
    """Whether a replica may be asked."""

    UNKNOWN = auto()
    SERVING = auto()
    OUT = auto()


class Member:
    """One replica."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.state = State.UNKNOWN
        self.questions = 0  # that it was chosen for, and has not answered
        self.outstanding: dict[Future[bytes], float] = {}  # those that are on their way, and since when
        self.used = 0  # when it was asked last, as a count of all questions
        self.failures = 0
        self.error: PlannerError | None = None  # why it is out
        self._probe: Future[bytes] | None = None
        self._probe_until = 0.0
        self._checked = 0.0
        self._retry = FIRST_RETRY_S
        self._retry_at = 0.0

    @property
    def name(self) -> str:
        return self.link.name

    def wants_probe(self, now: float) -> bool:
        """Whether it should be asked who it is."""
        if self._probe is not None:
            return False
        if self.state is not State.SERVING:
            return now >= self._retry_at
        oldest = min(self.outstanding.values(), default=now)
        return now - max(oldest, self._checked) > SUSPECT_S

    @property
    def needs_watching(self) -> bool:
        """Whether it may want a probe before it is next asked."""
        return self.state is not State.SERVING or bool(self.outstanding) or self._probe is not None

    def begin_probe(self, now: float, probe: "Future[bytes]") -> None:
        self._probe, self._probe_until = probe, now + 2 * PROBE_S

    def late_probe(self, now: float) -> "Future[bytes] | None":
        """The probe that has not ended as it should have by itself."""
        return self._probe if now > self._probe_until else None

    def end_probe(self, now: float) -> None:
        self._probe, self._checked = None, now

    def serve(self) -> None:
        """It has said who it is. One failure more puts it out again, until it has answered something."""
        if self.state is State.OUT:
            self.failures = FAILURES - 1
        self.state = State.SERVING
        self.error = None

    def succeed(self) -> None:
        """It has answered."""
        self.failures = 0
        self._retry = FIRST_RETRY_S

    def put_out(self, now: float, error: PlannerError) -> None:
        """It has failed."""
        self.state = State.OUT
        self.error = error
        self._retry_at = now + self._retry
        self._retry = min(2 * self._retry, LONGEST_RETRY_S)
