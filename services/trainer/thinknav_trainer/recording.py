"""A run made again without its planner, from what the planner said then.

`thoughts.jsonl` has a line for each reply, with the round in which it arrived and the name of its embedding;
`embeddings.jsonl` has each embedding once, by name, and the texts that were embedded; `planner.json` says who answered.
Knows files and messages; nothing of envs.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import (
    EmbedReply,
    EmbedRequest,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
    Timings,
    error_from_wire,
)
from thinknav_trainer.errors import UserError
from thinknav_trainer.planner import Answer, PlannerClient
from thinknav_trainer.thoughts import embedding_of

PLANNER, THOUGHTS, EMBEDDINGS = "planner.json", "thoughts.jsonl", "embeddings.jsonl"


class RecordingError(UserError):
    """A run that cannot be replayed; the message says why."""


class Recording:
    """A recorded run: who answered, what, when. Raises RecordingError for a folder that holds none."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            self.info = PlannerInfo.model_validate_json((folder / PLANNER).read_text())
            lines = list(_lines(folder / EMBEDDINGS))
            thoughts = list(_lines(folder / THOUGHTS))
        except OSError as error:
            raise RecordingError(f"{folder} cannot be replayed: cannot read {error.filename}") from None
        except ValueError as error:
            raise RecordingError(f"{folder} cannot be replayed: {error}") from None
        self._embeddings = {line["name"]: embedding_of(line) for line in lines}
        self._texts = {line["text"]: self._embeddings[line["name"]] for line in lines if line["text"] is not None}
        self._rounds: dict[int, dict[int, Answer]] = {}
        for line in thoughts:
            self._rounds.setdefault(line["round"], {})[line["env"]] = self._answer(line)

    def _answer(self, line: Mapping[str, Any]) -> Answer:
        if line["subgoal"] is None:
            return error_from_wire(line["error"])
        return SubgoalReply(
            request_id="recorded",
            subgoal=line["subgoal"],
            instructions=tuple(line.get("instructions", ())),
            embedding=self._embeddings[line["embedding"]],
            confidence=line.get("confidence"),
            planner=self.info.identity,
            timings=Timings(queued=0.0, planned=0.0, embedded=0.0),
        )

    def arrivals(self, number: int) -> dict[int, Answer]:
        """What came in a round, by env."""
        return self._rounds.get(number, {})

    def embed(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """The embeddings that these texts had. Raises RecordingError for one that was not embedded."""
        missing = [text for text in texts if text not in self._texts]
        if missing:
            raise RecordingError(f"{self.folder} has no embedding of {missing[0]!r}; did another version record it?")
        return np.stack([self._texts[text] for text in texts])

    def planner(self) -> PlannerClient:
        """Stands for the planner that was recorded."""
        return PlannerClient(RecordedTransport(self))


class RecordedTransport:
    """A planner that is no more: it says who it was, and how it embedded what it was asked to embed."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    def info(self) -> PlannerInfo:
        return self._recording.info

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[Answer]:  # noqa: ARG002
        raise RecordingError("a recorded planner answers in the recorded order alone: ask it by AskRecorded")

    def embed(self, request: EmbedRequest) -> EmbedReply:
        return EmbedReply(
            embedding_space=self._recording.info.embedding_space, embeddings=self._recording.embed(request.texts)
        )

    def close(self) -> None:
        """Nothing is held."""


class AskRecorded:
    """Replies arrive in the rounds in which they were recorded: `Asking` without anyone to ask."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._asked: set[int] = set()
        self._round = 0

    def ask(self, requests: Mapping[int, SubgoalRequest]) -> None:
        self._asked.update(requests)

    def replies(self, must_wait: bool) -> dict[int, Answer]:
        self._round += 1
        arrived = self._recording.arrivals(self._round)
        if not self._asked.issuperset(arrived) or (must_wait and not arrived):
            raise RecordingError(
                f"the replay has left its recording ({self._recording.folder}) in round {self._round}: "
                "the configuration, the machine or the version is another one, or the recorded run ended here"
            )
        self._asked.difference_update(arrived)
        return dict(arrived)


def _lines(path: Path) -> Iterable[dict[str, Any]]:
    with path.open() as file:
        yield from map(json.loads, file)
