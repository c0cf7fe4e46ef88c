"""A planner that is a function: for tests, for experiments with perfect or faulty planners, for runs without
a service.

with PlannerClient(MockTransport(lambda request: "turn left toward the doorway")) as planner: ...
"""

import functools
import time
from collections.abc import Callable, Sequence

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import (
    PROTOCOL_VERSION,
    DeadlineExceeded,
    EmbedReply,
    EmbedRequest,
    Limits,
    PlannerError,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
    Timings,
)

Handler = Callable[[SubgoalRequest], SubgoalReply | PlannerError | str]
Latency = float | Callable[[SubgoalRequest], float]


@functools.cache
def mock_info(planner: str = "mock", revision: str = "0") -> PlannerInfo:
    """What a planner in our own process says of itself: the mock, unless another is named."""
    return PlannerInfo(
        protocol_version=PROTOCOL_VERSION,
        planner=planner,
        revision=revision,
        prompt_hash="none",
        embedding_space=str(shipped_text_encoder().space),
        limits=Limits(
            max_frames=4096,
            max_pixels=4096 * 4096,
            max_body_bytes=2**30,
            max_text_length=10_000,
            max_texts=4096,
        ),
    )


class MockTransport:
    """Answers by calling `handler` for each request, in their order, in the caller's thread.

    handler: gives a reply, a PlannerError (returned or raised), or the text of a subgoal, which the
    embedded CLIP embeds. Any other exception reaches whoever asked.
    latency: seconds, or a function of the request that gives them. A body takes as long as its slowest
    request, as in a service that answers them side by side; a request slower than its deadline gets DeadlineExceeded.
    sleep: what waits; a test may put its own clock here.
    """

    def __init__(
        self,
        handler: Handler,
        latency: Latency = 0.0,
        info: PlannerInfo | None = None,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._handler = handler
        self._latency = latency
        self._info = info or mock_info()
        self._sleep = sleep

    def info(self) -> PlannerInfo:
        return self._info

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
        latencies = [self._latency(r) if callable(self._latency) else self._latency for r in requests]
        waits = [min(latency, r.deadline) for latency, r in zip(latencies, requests, strict=True)]
        if longest := max(waits, default=0.0):
            self._sleep(longest)
        return [self._answer(r, latency) for r, latency in zip(requests, latencies, strict=True)]

    def embed(self, request: EmbedRequest) -> EmbedReply:
        embeddings = shipped_text_encoder().encode(request.texts)
        return EmbedReply(embedding_space=self._info.embedding_space, embeddings=embeddings)

    def close(self) -> None:
        """Nothing is held."""

    def _answer(self, request: SubgoalRequest, latency: float) -> SubgoalReply | PlannerError:
        if latency > request.deadline:
            return DeadlineExceeded(f"no answer within the deadline of {request.deadline:g} s")
        try:
            answer = self._handler(request)
        except PlannerError as error:
            return error.as_value()
        return reply_to(request, answer, self._info, latency) if isinstance(answer, str) else answer


def reply_to(
    request: SubgoalRequest, subgoal: str, info: PlannerInfo | None = None, planned: float = 0.0
) -> SubgoalReply:
    """The reply that says `subgoal`, embedded by the embedded CLIP; in mode "plan" its only step."""
    who = info or mock_info()
    return SubgoalReply(
        request_id=request.request_id,
        subgoal=subgoal,
        instructions=(subgoal,) if request.mode == "plan" else (),
        embedding=shipped_text_encoder().encode([subgoal])[0],
        planner=who.identity,
        embedding_space=who.embedding_space,
        timings=Timings(queued=0.0, planned=planned, embedded=0.0),
    )
