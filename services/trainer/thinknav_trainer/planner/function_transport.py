"""A planner in our own process: two functions in the place of a service.

with PlannerClient(FunctionTransport(info, answer, embed)) as planner: ...

`MockTransport` answers one request at a time, for tests; this hands whole batches to what is, say, a network.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import EmbedReply, EmbedRequest, PlannerError, PlannerInfo, SubgoalReply, SubgoalRequest

Answer = Callable[[Sequence[SubgoalRequest]], Sequence[SubgoalReply | PlannerError]]
Embed = Callable[[Sequence[str]], NDArray[np.float32]]


class FunctionTransport:
    """Asks `answer` for replies and `embed` for embeddings (N, 512) of N texts, in the caller's thread.

    info: who answers. Exceptions other than a PlannerError reach whoever asked.
    """

    def __init__(self, info: PlannerInfo, answer: Answer, embed: Embed) -> None:
        self._info = info
        self._answer = answer
        self._embed = embed

    def info(self) -> PlannerInfo:
        return self._info

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
        return self._answer(requests)

    def embed(self, request: EmbedRequest) -> EmbedReply:
        return EmbedReply(embedding_space=self._info.embedding_space, embeddings=self._embed(request.texts))

    def close(self) -> None:
        """Nothing is held."""
