"""What the small CLIP learns from: frames, and of each a long sentence, a short one, a subgoal and a false one.

Batches are made in a worker process, each from its number alone, so that training can go on where it stopped.
"""

import itertools
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader, IterableDataset

from thinknav_models.clip.tokens import Vocabulary, split_words
from thinknav_sim.render import set_render_threads
from thinknav_trainer.model_training.clip_towers import PADDING
from thinknav_trainer.model_training.drawn_ahead import drawn_ahead
from thinknav_trainer.model_training.frames import FrameMaker, FramePlan
from thinknav_trainer.model_training.grammar import (
    DIRECTIONS,
    Said,
    describe,
    describe_briefly,
    describe_falsely,
    subgoal,
    subgoal_falsely,
)
from thinknav_trainer.model_training.scenery import Scenery

LONG, SHORT, SUBGOAL, FALSE = range(4)  # the kinds of sentences
KINDS = 4
NO_DIRECTION = len(DIRECTIONS)

_PREFETCH = 4  # batches


@dataclass(frozen=True)
class ClipBatch:
    """B frames and KINDS sentences of each.

    rgb: (B, H, W, 3) uint8. words: of each kind, (B, L) int64, PADDING after the end. same: (KINDS, B) int64, equal
    where sentences are. directions: (KINDS, B) int64, index into DIRECTIONS, NO_DIRECTION where a sentence gives none.
    """

    rgb: Tensor
    words: tuple[Tensor, ...]
    same: Tensor
    directions: Tensor


def sentences(seen: Scenery, random: Random) -> list[Said]:
    """One sentence of each kind about a frame."""
    false = subgoal_falsely(seen, random) if random.random() < 0.5 else Said(describe_falsely(seen, random))
    return [Said(describe(seen, random)), Said(describe_briefly(seen, random)), subgoal(seen, random), false]


def word_numbers(texts: Sequence[str], vocabulary: Vocabulary) -> Tensor:
    """(N, L) int64 of N texts; words that are strangers to the vocabulary are left out, and empty texts refused."""
    rows = [[number for word in split_words(text) if (number := vocabulary.number(word)) is not None] for text in texts]
    for row, text in zip(rows, texts, strict=True):
        if not row:
            raise ValueError(f"no word of {text!r} is in the vocabulary")
    numbers = torch.full((len(rows), max(map(len, rows))), PADDING)
    for index, row in enumerate(rows):
        numbers[index, : len(row)] = torch.tensor(row)
    return numbers


def clip_batch(maker: FrameMaker, vocabulary: Vocabulary, index: int) -> ClipBatch:
    """Batch number `index`, the same whenever it is made."""
    frames = maker.batch(index)
    random = Random(f"{maker.plan.seed} {index}")
    said = [sentences(seen, random) for seen in frames.sceneries]
    columns = [[row[kind] for row in said] for kind in range(KINDS)]
    flat = [item for column in columns for item in column]
    return ClipBatch(
        rgb=torch.from_numpy(np.ascontiguousarray(frames.rgb)),
        words=tuple(word_numbers([item.text for item in column], vocabulary) for column in columns),
        same=torch.tensor([zlib.crc32(item.text.encode()) for item in flat]).view(KINDS, -1),
        directions=torch.tensor(
            [NO_DIRECTION if item.direction is None else DIRECTIONS.index(item.direction) for item in flat]
        ).view(KINDS, -1),
    )


class ClipBatches(IterableDataset[ClipBatch]):
    """Batches from number `start` on, without end."""

    def __init__(self, plan: FramePlan, vocabulary: Sequence[str], start: int) -> None:
        self._plan = plan
        self._vocabulary = tuple(vocabulary)
        self._start = start

    def __iter__(self) -> Iterator[ClipBatch]:
        torch.set_num_threads(1)
        set_render_threads(1)
        maker, vocabulary = FrameMaker(self._plan), Vocabulary(self._vocabulary)
        for index in itertools.count(self._start):
            yield clip_batch(maker, vocabulary, index)


def clip_batches(plan: FramePlan, vocabulary: Sequence[str], start: int = 0) -> Iterator[ClipBatch]:
    """Batches from number `start` on, made ahead of time in a process of their own."""
    loader = DataLoader(
        ClipBatches(plan, vocabulary, start),
        batch_size=None,
        num_workers=1,
        prefetch_factor=_PREFETCH,
        multiprocessing_context="spawn",
    )
    return drawn_ahead(loader)
