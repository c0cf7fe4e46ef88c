"""One line of the log for each body that was answered: who asked, what became of it, where the time went."""

import logging
from collections import Counter
from collections.abc import Sequence

from thinknav_proto import PlannerError, SubgoalReply
from thinknav_server.caller import Caller

logger = logging.getLogger("thinknav_server.requests")


def log_answers(caller: Caller, answers: Sequence[SubgoalReply | PlannerError], seconds: float) -> None:
    """Milliseconds of stages are those of the slowest request in the body."""
    if not logger.isEnabledFor(logging.INFO):
        return
    timings = [answer.timings for answer in answers if isinstance(answer, SubgoalReply)]
    errors = Counter(answer.code for answer in answers if isinstance(answer, PlannerError))
    fields: dict[str, object] = {"door": caller.door, "client": caller.name, "requests": len(answers)}
    fields |= {"answered": len(timings), "ms": _ms(seconds)}
    if timings:
        fields["queued_ms"] = _ms(max(timing.queued for timing in timings))
        fields["planned_ms"] = _ms(max(timing.planned for timing in timings))
        fields["embedded_ms"] = _ms(max(timing.embedded for timing in timings))
    if errors:
        fields["errors"] = dict(errors)
    if caller.trace:
        fields["trace_id"] = caller.trace.trace_id
    logger.info("subgoals", extra={"fields": fields})


def _ms(seconds: float) -> float:
    return round(1000 * seconds, 2)
