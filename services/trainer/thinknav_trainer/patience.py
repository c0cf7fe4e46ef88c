"""How long a run goes on without its planner. Knows nothing of transports."""

import logging
import time
from collections.abc import Callable, Sequence

from thinknav_proto import PlannerError, SubgoalReply, Unavailable

logger = logging.getLogger(__name__)


class Patience:
    """Watches replies, and gives up when there was none for longer than `seconds`.

    One answered request is enough to begin anew. The time counts from the first failure in a row, so that a run in
    which nobody thinks never loses patience.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._seconds = seconds
        self._clock = clock
        self._failing_since: float | None = None

    def observe(self, replies: Sequence[SubgoalReply | PlannerError]) -> None:
        """Take note of the replies to one batch. Raises Unavailable when patience is at its end."""
        errors = [reply for reply in replies if isinstance(reply, PlannerError)]
        if len(errors) < len(replies):
            if self._failing_since is not None:
                logger.warning("the planner answers again after %.1f s", self._clock() - self._failing_since)
            self._failing_since = None
            return
        if not errors:
            return
        if self._failing_since is None:
            self._failing_since = self._clock()
            logger.warning(
                "the planner failed (%s); going on without thoughts for up to %g s", errors[0], self._seconds
            )
        gone = self._clock() - self._failing_since
        if gone >= self._seconds:
            raise Unavailable(
                f"the planner has not answered for {gone:.0f} s (think.patience is {self._seconds:g} s): {errors[0]}"
            )
