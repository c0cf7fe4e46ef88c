"""The last answers, kept for the status page. Frames only if that was asked for: they may be private."""

import time
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from thinknav_proto import Frame, SubgoalReply, SubgoalRequest, Timings
from thinknav_server.caller import Caller

_ANSWERS = 1000
_FRAMES = 12


@dataclass(frozen=True)
class Seen:
    """A frame and what was said to it. at: seconds since the epoch."""

    frame: Frame
    goal: str
    subgoal: str
    client: str
    at: float = field(default_factory=time.time)


class Recent:
    """The timings of the last thousand answers, the sizes of all batches, the last dozen frames."""

    def __init__(self, keep_frames: bool) -> None:
        self.keeps_frames = keep_frames
        self.batches: Counter[int] = Counter()
        self.answers: deque[tuple[float, Timings]] = deque(maxlen=_ANSWERS)
        self.frames: deque[Seen] = deque(maxlen=_FRAMES)

    def batch(self, size: int) -> None:
        """A batch was answered."""
        self.batches[size] += 1

    def answer(self, request: SubgoalRequest, reply: SubgoalReply, caller: Caller, seconds: float) -> None:
        """A request was answered, `seconds` after it came."""
        self.answers.append((seconds, reply.timings))
        if self.keeps_frames:
            self.frames.append(
                Seen(request.frame, request.goal, "; ".join(reply.instructions) or reply.subgoal, caller.name)
            )

    def quantiles(self, shares: Sequence[float]) -> dict[str, list[float]]:
        """Milliseconds within which shares of the answers passed each stage; nothing before the first answer."""
        if not self.answers:
            return {}
        stages = {
            "in all": [seconds for seconds, _ in self.answers],
            "in the queue": [timings.queued for _, timings in self.answers],
            "decoding and planning": [timings.planned for _, timings in self.answers],
            "embedding": [timings.embedded for _, timings in self.answers],
        }
        return {stage: [_quantile(sorted(values), share) for share in shares] for stage, values in stages.items()}


def _quantile(ordered: Sequence[float], share: float) -> float:
    return 1000 * ordered[min(int(share * len(ordered)), len(ordered) - 1)]
