"""How the thoughts of N envs are asked for: waited for together, one by one while the other envs go on, or not at all.

Knows requests and replies by the env that asks; nothing of what a thought does to it.
"""

from collections.abc import Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Protocol

import numpy as np

from thinknav_proto import EMBEDDING_DIMENSION, PlannerInfo, SubgoalReply, SubgoalRequest, Timings
from thinknav_trainer.planner import Answer, PlannerClient

UNHEARD = "unheard"


class Asking(Protocol):
    """Questions under way, at most one an env."""

    def ask(self, requests: Mapping[int, SubgoalRequest]) -> None:
        """Ask for these envs."""

    def replies(self, must_wait: bool) -> dict[int, Answer]:
        """What has come back since the last call, by env, in the envs' order; each reply is given once.

        must_wait: there is nothing else to do: do not come back with nothing while anything is under way.
        """


class AskTogether:
    """All in one request, and all waited for: what makes envs move in lock-step, and runs repeatable."""

    def __init__(self, planner: PlannerClient) -> None:
        self._planner = planner
        self._requests: dict[int, SubgoalRequest] = {}

    def ask(self, requests: Mapping[int, SubgoalRequest]) -> None:
        self._requests |= requests

    def replies(self, must_wait: bool) -> dict[int, Answer]:  # noqa: ARG002 - it always waits
        asked, self._requests = sorted(self._requests.items()), {}
        answers = self._planner.ask([request for _, request in asked])
        return {env: answer for (env, _), answer in zip(asked, answers, strict=True)}


class AskApart:
    """Each on its own; who has no reply yet holds nobody up."""

    def __init__(self, planner: PlannerClient) -> None:
        self._planner = planner
        self._futures: dict[int, Future[Answer]] = {}

    def ask(self, requests: Mapping[int, SubgoalRequest]) -> None:
        futures = self._planner.submit(list(requests.values()))
        self._futures |= zip(requests, futures, strict=True)

    def replies(self, must_wait: bool) -> dict[int, Answer]:
        if must_wait:
            wait(self._futures.values(), return_when=FIRST_COMPLETED)
        done = sorted(env for env, future in self._futures.items() if future.done())
        return {env: self._futures.pop(env).result() for env in done}


class AskNobody:
    """Answers at once, with words that stand for any: for agents who are not told what their planner says.

    info: whom they believe to ask.
    """

    def __init__(self, info: PlannerInfo) -> None:
        self._info = info
        self._requests: dict[int, SubgoalRequest] = {}

    def ask(self, requests: Mapping[int, SubgoalRequest]) -> None:
        self._requests |= requests

    def replies(self, must_wait: bool) -> dict[int, Answer]:  # noqa: ARG002 - there is nothing to wait for
        asked, self._requests = sorted(self._requests.items()), {}
        return {env: self._unheard(request) for env, request in asked}

    def _unheard(self, request: SubgoalRequest) -> SubgoalReply:
        return SubgoalReply(
            request_id=request.request_id,
            subgoal=UNHEARD,
            instructions=(UNHEARD,) if request.mode == "plan" else (),
            embedding=np.zeros(EMBEDDING_DIMENSION, np.float32),
            embedding_space=self._info.embedding_space,
            planner=self._info.identity,
            timings=Timings(queued=0.0, planned=0.0, embedded=0.0),
        )
