"""What carries questions to a planner: HTTP to a service, or a function that stands in for one."""

from collections.abc import Sequence
from typing import Protocol

from thinknav_proto import EmbedReply, EmbedRequest, PlannerError, PlannerInfo, SubgoalReply, SubgoalRequest


class Transport(Protocol):
    """Carries whole bodies, from any number of threads at once. What it raises is a PlannerError."""

    def info(self) -> PlannerInfo:
        """Ask who answers."""

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
        """Ask one body; its answers in the order of the requests. Raises what befell the body as a whole."""

    def embed(self, request: EmbedRequest) -> EmbedReply:
        """Ask for the embeddings of texts."""

    def close(self) -> None:
        """Free what it holds."""
