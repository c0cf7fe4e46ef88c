"""A thought: what came back when an env asked its planner. Knows messages; nothing of envs and files."""

import base64
import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import PlannerError, SubgoalReply
from thinknav_trainer.planner import Answer


@dataclass(frozen=True)
class Thought:
    """One reply: which env asked, for which goal, what came back.

    round: when it came back, counted in looks for replies since the run began; the order of a run that does not wait.
    """

    env: int
    goal: str
    answer: Answer
    round: int = 0

    @property
    def subgoal(self) -> str | None:
        """None when the planner failed."""
        return self.answer.subgoal if isinstance(self.answer, SubgoalReply) else None

    @property
    def error(self) -> str | None:
        """What went wrong, None when nothing did."""
        return f"{type(self.answer).__name__}: {self.answer}" if isinstance(self.answer, PlannerError) else None

    @property
    def confidence(self) -> float | None:
        """None from a planner that has none, or that failed."""
        return self.answer.confidence if isinstance(self.answer, SubgoalReply) else None

    @property
    def seconds(self) -> float:
        """What the reply took by the service's account, waiting in its queue included."""
        if not isinstance(self.answer, SubgoalReply):
            return 0.0
        timings = self.answer.timings
        return timings.queued + timings.planned + timings.embedded

    @property
    def line(self) -> dict[str, Any]:
        """As thoughts.jsonl has it: the embedding by its name."""
        told: dict[str, Any] = {"round": self.round, "env": self.env, "goal": self.goal, "subgoal": self.subgoal}
        if isinstance(self.answer, PlannerError):
            return told | {"error": self.answer.to_wire()}
        told["embedding"] = embedding_name(self.answer.embedding)
        if self.answer.instructions:
            told["instructions"] = list(self.answer.instructions)
        if self.confidence is not None:
            told["confidence"] = self.confidence
        return told


def embedding_name(embedding: NDArray[np.float32]) -> str:
    """The same for the same numbers, and for no others."""
    return hashlib.sha256(embedding.astype("<f4").tobytes()).hexdigest()[:16]


def embedding_line(embedding: NDArray[np.float32], text: str | None = None) -> dict[str, Any]:
    """As embeddings.jsonl has it. text: what was embedded, where that was asked for by itself."""
    data = base64.b64encode(embedding.astype("<f4").tobytes()).decode()
    return {"name": embedding_name(embedding), "text": text, "data": data}


def embedding_of(line: dict[str, Any]) -> NDArray[np.float32]:
    """What `embedding_line` wrote."""
    return np.frombuffer(base64.b64decode(line["data"]), "<f4").astype(np.float32)
