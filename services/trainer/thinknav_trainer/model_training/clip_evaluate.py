"""What the small CLIP can do, in homes that it has never seen, beside what can be had without looking.

Retrieval: of 100 frames and 100 sentences, one about each, which belong together? Controls: a blank frame, another
frame, and the text prior, which ranks sentences the same for every frame, by how well they suit frames at large.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random

import numpy as np
import torch
from numpy.typing import NDArray

from thinknav_models.clip.image import ClipImageEncoder
from thinknav_models.clip.text import ClipTextEncoder
from thinknav_trainer.model_training.frames import FrameMaker, FramePlan, Frames
from thinknav_trainer.model_training.grammar import DIRECTIONS, NAMES, SUBGOALS, describe, subgoal, subgoal_falsely
from thinknav_trainer.model_training.scenery import Scenery
from thinknav_trainer.statistics import bootstrap_interval

CHOICES = 100  # frames and sentences that are told apart
FRAMES = 500
GREY = 128
EVALUATION_SEED = 20_261

Embeddings = NDArray[np.float32]


@dataclass(frozen=True)
class Measure:
    """A share of frames, with its 95 % bootstrap interval."""

    name: str
    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class DirectionGap:
    """How far subgoals of different directions lie apart, each pair about the same thing.

    same, other: mean cosine of two sentences of one direction, and of two. closest: the greatest cosine of two
    sentences of different directions. sorted_right: share of sentences nearest to the mean of their own direction's
    other wordings.
    """

    same: float
    other: float
    closest: float
    sorted_right: float


def evaluation_frames(plan: FramePlan) -> Frames:
    """FRAMES frames in a fixed order, spread over scenes so that any CHOICES in a row are of many of them."""
    frames = FrameMaker(plan).batch(0)
    order = np.random.default_rng(EVALUATION_SEED).permutation(len(frames.rgb))
    return Frames(frames.rgb[order], [frames.sceneries[index] for index in order.tolist()], frames.scenes[order])


def evaluate_clip(image_encoder: ClipImageEncoder, text_encoder: ClipTextEncoder, frames: Frames) -> list[Measure]:
    """Retrieval both ways and its controls, then how often a true sentence beats a false one.

    Where nothing stands to one side alone, no sentence is false when it is mirrored, and that measure is left out.
    """
    random = Random(EVALUATION_SEED)
    sentences = [describe(seen, random) for seen in frames.sceneries]
    texts = text_encoder.encode(sentences)
    images = _encode(image_encoder, frames.rgb)
    blank = np.repeat(_encode(image_encoder, np.full_like(frames.rgb[:1], GREY)), len(images), axis=0)
    other = np.roll(images, 1, axis=0)
    prior = np.repeat(images.mean(axis=0, keepdims=True), len(images), axis=0)
    measures = []
    for name, of, to in (
        ("frame to sentence", images, texts),
        ("sentence to frame", texts, images),
        ("control: blank frame", blank, texts),
        ("control: another frame", other, texts),
        ("control: text prior", prior, texts),
    ):
        ranks = _ranks(of, to)
        measures += [_measure(f"{name}, R@{top}", ranks < top) for top in (1, 5)]
    if any(map(_is_lopsided, frames.sceneries)):
        mirrored = _beats_mirrored(images, text_encoder, frames)
        measures.append(_measure("its sentence over the same one mirrored", mirrored))
        measures.append(_measure("control: the same, blank frame", _beats_mirrored(blank, text_encoder, frames)))
    measures.append(_measure("subgoal over one of another direction", _beats_false(images, text_encoder, frames)))
    measures.append(_measure("control: the same, blank frame", _beats_false(blank, text_encoder, frames)))
    return measures


def direction_gap(encode: Callable[[Sequence[str]], Embeddings]) -> DirectionGap:
    """How well a text encoder keeps left, right, forward and stop apart."""
    things = [names[0] for names in NAMES.values()] + ["doorway"]
    groups = [[wording for wording in SUBGOALS[direction] if "{}" in wording] for direction in DIRECTIONS]
    wordings = min(map(len, groups))
    same, other, right = [], [], []
    for thing in things:
        texts = [wording.format(thing) for group in groups for wording in group[:wordings]]
        embeddings = encode(texts).reshape(len(DIRECTIONS), wordings, -1)
        cosines = np.einsum("adk,bek->abde", embeddings, embeddings)
        pairs = ~np.eye(wordings, dtype=bool)
        for first in range(len(DIRECTIONS)):
            same.append(cosines[first, first][pairs])
            other += [cosines[first, second].ravel() for second in range(first)]
        right.append(_nearest_is_own(embeddings))
    others = np.concatenate(other)
    return DirectionGap(
        float(np.concatenate(same).mean()),
        float(others.mean()),
        float(others.max()),
        float(np.concatenate(right).mean()),
    )


def _nearest_is_own(embeddings: Embeddings) -> NDArray[np.bool_]:
    """(directions x wordings,): each sentence against the means of its directions' others, itself left out."""
    directions, wordings, _ = embeddings.shape
    sums = embeddings.sum(axis=1)
    own = np.empty((directions, wordings), np.bool_)
    for direction in range(directions):
        for wording in range(wordings):
            means = sums.copy()
            means[direction] -= embeddings[direction, wording]
            means /= np.linalg.norm(means, axis=1, keepdims=True)
            own[direction, wording] = int((means @ embeddings[direction, wording]).argmax()) == direction
    return own.ravel()


def _encode(encoder: ClipImageEncoder, rgb: NDArray[np.uint8]) -> Embeddings:
    embeddings: Embeddings = encoder.encode(torch.from_numpy(np.ascontiguousarray(rgb))).numpy()
    return embeddings


def _ranks(of: Embeddings, to: Embeddings) -> NDArray[np.float64]:
    """How many of CHOICES, in a row, come before the right one; those as near as it count half, as by chance."""
    ranks = []
    for start in range(0, len(of) - CHOICES + 1, CHOICES):
        scores = of[start : start + CHOICES] @ to[start : start + CHOICES].T
        right = np.diagonal(scores)[:, None]
        ranks.append((scores > right).sum(axis=1) + 0.5 * ((scores == right).sum(axis=1) - 1))
    return np.concatenate(ranks)


def _beats_mirrored(images: Embeddings, text_encoder: ClipTextEncoder, frames: Frames) -> NDArray[np.bool_]:
    """Where a frame shows something on one side alone: is its sentence nearer than with left and right exchanged?"""
    rows, true, false = [], [], []
    for row, seen in enumerate(frames.sceneries):
        if _is_lopsided(seen):
            rows.append(row)
            true.append(describe(seen, Random(row)))
            false.append(describe(seen.mirrored(), Random(row)))
    return _nearer(images[rows], text_encoder.encode(true), text_encoder.encode(false))


def _is_lopsided(seen: Scenery) -> bool:
    """Whether the sentence and its mirror image are not both true, and differ in nothing but left and right."""
    places = {(sight.category, sight.side) for sight in seen.sights}
    other = {(sight.category, sight.side) for sight in seen.mirrored().sights}
    return not any(place in other for place in places if place[1] != "ahead") and any(
        side != "ahead" for _, side in places
    )


def _beats_false(images: Embeddings, text_encoder: ClipTextEncoder, frames: Frames) -> NDArray[np.bool_]:
    true, false = [], []
    for row, seen in enumerate(frames.sceneries):
        true.append(subgoal(seen, Random(row)).text)
        false.append(subgoal_falsely(seen, Random(row)).text)
    return _nearer(images, text_encoder.encode(true), text_encoder.encode(false))


def _nearer(images: Embeddings, true: Embeddings, false: Embeddings) -> NDArray[np.bool_]:
    nearer: NDArray[np.bool_] = (images * true).sum(axis=1) > (images * false).sum(axis=1)
    return nearer


def _measure(name: str, hits: NDArray[np.bool_]) -> Measure:
    low, high = bootstrap_interval(hits.astype(float).tolist())
    return Measure(name, float(hits.mean()), low, high)
