"""The embedded subgoal VLM: frames and a goal in, a subgoal out, word by word.

It says `stop` when it is sure enough, and then always; else never, for a false stop ends an episode. Other directions
and the words after them are the most likely ones, or drawn at a temperature. Knows nothing of services and homes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from thinknav_models.bfloat16 import bfloat16_is_fast
from thinknav_models.subgoal_language import DIRECTIONS, SPECIAL, Vocabulary
from thinknav_models.subgoal_network import (
    IMAGE_SIZE,
    MODES,
    Memory,
    NetworkConfig,
    SubgoalNetwork,
    fold_normalisation,
)
from thinknav_models.weights import SHIPPED, load_weights, save_weights

KIND = "subgoal-vlm"
SHIPPED_FILE = SHIPPED / "subgoal_vlm.safetensors"
MAX_RECENT = 4  # earlier views that it was taught with; of more, the latest count

MAX_SENTENCES = 5  # of a plan

_CHUNK = 16  # frames at once: what lies between layers then stays in the processor's cache
_LONGEST = {"subgoal": 14, "plan": 60}  # tokens
_STOP = DIRECTIONS.index("stop")


@dataclass(frozen=True)
class Question:
    """What lies ahead, and where to go for the goal?

    frame: (H, W, 3) uint8. recent: earlier frames, oldest first, and their headings in radians relative to `frame`,
    left positive. temperature: of drawing; 0 takes the most likely words.
    """

    frame: NDArray[np.uint8]
    goal: str
    recent: tuple[tuple[NDArray[np.uint8], float], ...] = ()
    mode: Literal["subgoal", "plan"] = "subgoal"
    temperature: float = 0.0


@dataclass(frozen=True)
class Answer:
    """sentences: one in mode "subgoal", one to five in mode "plan". confidence: 0 to 1, in the (first) direction.

    words: each of the answer's tokens with its probability given those before it.
    """

    sentences: tuple[str, ...]
    confidence: float
    words: tuple[tuple[str, float], ...]


class SubgoalVLM:
    """A taught network and its words. One thread at a time may ask it."""

    def __init__(self, vocabulary: Vocabulary, network: SubgoalNetwork, stop_gate: float, seed: int = 0) -> None:
        """Take over a network. stop_gate: how probable `stop` must be to be said. seed: of what is drawn."""
        self.vocabulary = vocabulary
        self.stop_gate = stop_gate
        self.network = network.eval()
        fold_normalisation(network.trunk)
        network.trunk.to(torch.bfloat16 if bfloat16_is_fast() else torch.float32)
        self._generator = torch.Generator().manual_seed(seed)
        self._never = torch.zeros(len(vocabulary), dtype=torch.bool)
        self._never[[vocabulary.padding, vocabulary.unknown]] = True

    @classmethod
    def load(cls, path: Path = SHIPPED_FILE, seed: int = 0) -> tuple[Self, str]:
        """The model in a file, the shipped one unless named, and its revision. Raises WeightsError."""
        taught = load_network(path)
        return cls(taught.vocabulary, taught.network, taught.stop_gate, seed), taught.revision

    def draw_from(self, seed: int) -> None:
        """Whatever is drawn from now on follows from this seed (below 2**63), not from what was asked before."""
        self._generator.manual_seed(seed)

    def answer(self, questions: Sequence[Question]) -> list[Answer]:
        """One answer for each question, in their order. Raises ValueError for a frame that is no image."""
        answers: dict[int, Answer] = {}
        for mode in MODES:
            numbers = [number for number, question in enumerate(questions) if question.mode == mode]
            if numbers:
                asked = [questions[number] for number in numbers]
                answers |= dict(zip(numbers, self._answer_mode(asked, mode), strict=True))
        return [answers[number] for number in range(len(questions))]

    @torch.inference_mode()
    def directions(self, questions: Sequence[Question]) -> NDArray[np.float32]:
        """(N, 4): how probable each of DIRECTIONS is, before the gate on `stop`."""
        memory, first = self._look(questions, "subgoal")
        hidden, _ = self.network.decode(first, torch.zeros(len(questions), 0, dtype=torch.long), memory)
        logits = self.network.logits(hidden[:, -1])[:, list(self.vocabulary.directions)]
        probabilities: NDArray[np.float32] = logits.softmax(dim=1).numpy()
        return probabilities

    @torch.inference_mode()
    def _answer_mode(self, questions: Sequence[Question], mode: str) -> list[Answer]:
        memory, first = self._look(questions, mode)
        temperatures = torch.tensor([question.temperature for question in questions])[:, None]
        tokens = torch.zeros(len(questions), 0, dtype=torch.long)
        chances = torch.zeros(len(questions), 0)
        ended = torch.zeros(len(questions), dtype=torch.bool)
        past = None
        while tokens.shape[1] < _LONGEST[mode] and not ended.all():
            hidden, past = self.network.decode(first, tokens[:, -1:] if past is not None else tokens, memory, past)
            logits = self.network.logits(hidden[:, -1])
            token = self._draw(logits.masked_fill(~self._allowed(logits, tokens, mode), -torch.inf), temperatures)
            token[ended] = self.vocabulary.padding
            chance = logits.softmax(dim=1).gather(1, token[:, None])
            tokens, chances = torch.cat([tokens, token[:, None]], dim=1), torch.cat([chances, chance], dim=1)
            ended |= token == self.vocabulary.end
        return [self._worded(*row) for row in zip(tokens.tolist(), chances.tolist(), strict=True)]

    def _look(self, questions: Sequence[Question], mode: str) -> tuple[Memory, Tensor]:
        """Run the trunk over all frames, and prepare what the decoder attends to and begins with."""
        recent = [question.recent[-MAX_RECENT:] for question in questions]
        count = max(map(len, recent))
        views = torch.full((len(questions), 1 + count), -1)
        headings = torch.zeros(len(questions), count)
        frames: list[NDArray[np.uint8]] = []
        for row, (question, earlier) in enumerate(zip(questions, recent, strict=True)):
            views[row, : 1 + len(earlier)] = torch.arange(len(frames), len(frames) + 1 + len(earlier))
            headings[row, : len(earlier)] = torch.tensor([heading for _, heading in earlier])
            frames += [question.frame, *(frame for frame, _ in earlier)]
        chunks = torch.split(_stacked([_pixels(frame) for frame in frames]), _CHUNK)
        features = torch.cat([self.network.trunk(chunk).float() for chunk in chunks])
        words = [self.vocabulary.encode(question.goal) or [self.vocabulary.unknown] for question in questions]
        first = self.network.first_token(
            torch.tensor([word for goal in words for word in goal]),
            torch.tensor([len(goal) for goal in words]),
            torch.full((len(questions),), MODES.index(mode)),
        )
        return self.network.remember(features, views, headings), first

    def _allowed(self, logits: Tensor, tokens: Tensor, mode: str) -> Tensor:
        """(N, words) bool: what may be said after the tokens (N, so far). A sentence begins with a direction.

        A subgoal is one sentence, and its `stop` must be sure.
        """
        said = (tokens == self.vocabulary.next).sum(dim=1)
        beginning = (
            tokens[:, -1] == self.vocabulary.next if tokens.shape[1] else torch.ones(len(logits), dtype=torch.bool)
        )
        directions = list(self.vocabulary.directions)
        opening = torch.zeros(len(self.vocabulary), dtype=torch.bool)
        opening[directions] = True
        allowed = torch.where(beginning[:, None], opening, ~self._never)
        allowed[:, self.vocabulary.next] &= (said < MAX_SENTENCES - 1) & (mode == "plan")
        if mode == "subgoal" and not tokens.shape[1]:
            sure = logits[:, directions].softmax(dim=1)[:, _STOP] >= self.stop_gate
            allowed[:, directions] &= sure[:, None] == (torch.arange(len(directions)) == _STOP)
        return allowed

    def _draw(self, logits: Tensor, temperatures: Tensor) -> Tensor:
        """A token of each row (N, words): the likeliest, or drawn where the temperature (N, 1) is not 0."""
        uniform = torch.rand(logits.shape, generator=self._generator).clamp_(min=1e-20)
        return (logits - temperatures * torch.log(-torch.log(uniform))).argmax(dim=1)

    def _worded(self, tokens: list[int], chances: list[float]) -> Answer:
        parts: list[list[int]] = [[]]
        for token in tokens:
            if token == self.vocabulary.next:
                parts.append([])
            elif token >= len(SPECIAL):
                parts[-1].append(token)
        words = [
            (self.vocabulary.tokens[token], chance)
            for token, chance in zip(tokens, chances, strict=True)
            if token >= len(SPECIAL)
        ]
        sentences = tuple(self.vocabulary.decode(part) for part in parts if part)
        return Answer(sentences, chances[0], tuple(words))


def save(path: Path, vocabulary: Vocabulary, network: SubgoalNetwork, stop_gate: float, **facts: Any) -> str:
    """Write a model for `SubgoalVLM.load`; returns its revision. facts: what else to remember in its configuration."""
    config: Mapping[str, Any] = {
        "words": list(vocabulary.words),
        "network": asdict(network.config),
        "stop_gate": stop_gate,
        **facts,
    }
    tensors = {
        name: value.float().numpy()
        for name, value in network.state_dict().items()
        if not name.endswith("num_batches_tracked")  # which no answer depends on, and half precision could not count
    }
    return save_weights(path, KIND, config, tensors)


@dataclass(frozen=True)
class TaughtNetwork:
    """What a file of weights holds; revision: its hash."""

    vocabulary: Vocabulary
    network: SubgoalNetwork
    stop_gate: float
    revision: str


def load_network(path: Path = SHIPPED_FILE) -> TaughtNetwork:
    """The network in a file, as it was taught. Raises WeightsError."""
    weights = load_weights(path, KIND)
    vocabulary = Vocabulary(weights.config["words"])
    sizes = weights.config["network"]
    network = SubgoalNetwork(NetworkConfig(**(sizes | {"channels": tuple(sizes["channels"])})))
    tensors = {name: torch.from_numpy(tensor) for name, tensor in weights.tensors.items()}
    network.load_state_dict(network.state_dict() | tensors)
    return TaughtNetwork(vocabulary, network, float(weights.config["stop_gate"]), weights.revision)


def _pixels(frame: NDArray[np.uint8]) -> Tensor:
    """A frame (H, W, 3) uint8 as the network takes it: (128, 128, 3), float32 where pixels had to be averaged."""
    if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8 or not frame.size:
        raise ValueError(f"a frame must be (H, W, 3) uint8, not {frame.shape} {frame.dtype}")
    if IMAGE_SIZE % frame.shape[0] == 0 == IMAGE_SIZE % frame.shape[1]:  # each area is of one pixel: no averages
        rows, columns = (IMAGE_SIZE // side for side in frame.shape[:2])
        return torch.from_numpy(frame.repeat(rows, axis=0).repeat(columns, axis=1))
    pixels = torch.from_numpy(np.array(frame))  # a copy: what a decoder gives may not be writable
    sized = functional.interpolate(pixels.permute(2, 0, 1)[None].float(), (IMAGE_SIZE, IMAGE_SIZE), mode="area")
    return sized[0].permute(1, 2, 0)


def _stacked(pixels: Sequence[Tensor]) -> Tensor:
    """(N, 128, 128, 3) uint8 where all are, a quarter of the memory, else float32."""
    if any(frame.is_floating_point() for frame in pixels):
        pixels = [frame.float() for frame in pixels]
    return torch.stack(list(pixels))
