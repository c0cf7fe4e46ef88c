"""The embedded planner in the trainer's own process: the same small subgoal VLM as the planning service's `embedded`,
with the same gate and the same words, and no service.

All frames of a batch go through the network at once. Requests that are asked again in the same order get the same
answers, at any temperature: what is drawn follows from the seed and from the first request's number, so that a run that
goes on draws as one that was never stopped. What was asked lately and is not drawn is not worked out again: agents who
turn to and fro ask about the same few views.
"""

import hashlib
import time
import zlib
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from thinknav_models.clip import shipped_text_encoder
from thinknav_models.subgoal_vlm import Answer, Question, SubgoalVLM
from thinknav_proto import Frame, InvalidRequest, PlannerError, SubgoalReply, SubgoalRequest, Timings
from thinknav_trainer.planner.client import PlannerClient
from thinknav_trainer.planner.function_transport import FunctionTransport
from thinknav_trainer.planner.mock_transport import mock_info

NAME = "embedded"
_REMEMBERED = 8192  # answers, some 4 MB


class EmbeddedPlanner(PlannerClient):
    """A planner client without a network; one thread at a time may ask it. seed: of what is drawn at a temperature."""

    def __init__(self, seed: int = 0) -> None:
        self._model, revision = SubgoalVLM.load(seed=seed)
        self._seed = seed
        self._told = mock_info(NAME, revision)
        self._embeddings: dict[str, NDArray[np.float32]] = {}
        self._remembered: OrderedDict[bytes, Answer] = OrderedDict()
        super().__init__(FunctionTransport(self._told, self._answer, shipped_text_encoder().encode))

    def _answer(self, requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
        """One forward for all of them; a frame that is no image fails alone."""
        began = time.perf_counter()
        asked = [_question(request) for request in requests]
        questions = [question for question in asked if isinstance(question, Question)]
        if not questions:
            return [question for question in asked if isinstance(question, PlannerError)]
        self._model.draw_from(zlib.crc32(f"{self._seed} {requests[0].request_id}".encode()))
        answers = iter(self._answers(questions))
        planned = time.perf_counter() - began
        return [
            question if isinstance(question, PlannerError) else self._reply(request, next(answers), planned)
            for request, question in zip(requests, asked, strict=True)
        ]

    def _answers(self, questions: Sequence[Question]) -> list[Answer]:
        keys = [_key(question) for question in questions]
        known = {number: self._remembered[key] for number, key in enumerate(keys) if key and key in self._remembered}
        new = [number for number in range(len(questions)) if number not in known]
        if new:
            known |= zip(new, self._model.answer([questions[number] for number in new]), strict=True)
        for number, key in enumerate(keys):
            if key is not None:
                self._remembered[key] = known[number]
                self._remembered.move_to_end(key)
        while len(self._remembered) > _REMEMBERED:
            self._remembered.popitem(last=False)
        return [known[number] for number in range(len(questions))]

    def _reply(self, request: SubgoalRequest, answer: Answer, planned: float) -> SubgoalReply:
        subgoal = answer.sentences[0]
        if subgoal not in self._embeddings:
            # By itself: in a batch its last bits would depend on what else was said.
            [self._embeddings[subgoal]] = shipped_text_encoder().encode([subgoal])
        return SubgoalReply(
            request_id=request.request_id,
            subgoal=subgoal,
            instructions=answer.sentences if request.mode == "plan" else (),
            embedding=self._embeddings[subgoal],
            embedding_space=self._told.embedding_space,
            confidence=answer.confidence,
            planner=self._told.identity,
            timings=Timings(queued=0.0, planned=planned, embedded=0.0),
        )


def _key(question: Question) -> bytes | None:
    """Equal for questions that are the same; None for one whose answer is drawn."""
    if question.temperature > 0:
        return None
    digest = hashlib.blake2b(f"{question.mode}\0{question.goal}".encode(), digest_size=16)
    for pixels, heading in ((question.frame, 0.0), *question.recent):
        digest.update(f"\0{pixels.shape} {heading!r}\0".encode())
        digest.update(pixels.tobytes())
    return digest.digest()


def _question(request: SubgoalRequest) -> Question | PlannerError:
    try:
        return Question(
            _pixels(request.frame),
            request.goal,
            tuple((_pixels(frame), frame.heading) for frame in request.recent),
            request.mode,
            request.temperature,
        )
    except InvalidRequest as error:
        return error.as_value()


def _pixels(frame: Frame) -> NDArray[np.uint8]:
    """(H, W, 3) uint8. Raises InvalidRequest."""
    if frame.encoding == "raw" and frame.width is not None and frame.height is not None:
        return np.frombuffer(frame.data, np.uint8).reshape(frame.height, frame.width, 3)
    if frame.encoding != "jpeg":
        raise InvalidRequest(f"the embedded planner takes raw and JPEG frames, not {frame.encoding}")
    try:
        pixels: NDArray[np.uint8] = simplejpeg.decode_jpeg(frame.data, colorspace="RGB")
    except ValueError as error:
        raise InvalidRequest(f"the JPEG frame cannot be decoded: {error}") from None
    return pixels
