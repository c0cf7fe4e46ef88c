"""Which of some sentences lie nearest to a frame: what the small CLIP makes of it, in words."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from thinknav_models.clip.image import ClipImageEncoder
from thinknav_models.clip.text import ClipTextEncoder

_THINGS = (
    *("bathtub", "bed", "cabinet", "chair", "counter", "desk", "dresser", "fridge", "lamp", "mirror", "nightstand"),
    *("picture", "plant", "rug", "shelf", "shower", "sink", "sofa", "stove", "table", "toilet", "tv", "wardrobe"),
    "doorway",
)
_ROOMS = ("bathroom", "bedroom", "dining room", "hallway", "kitchen", "living room", "studio", "study")
_SIDES = ("on the left", "straight ahead", "on the right")


@dataclass(frozen=True)
class Near:
    """A sentence and its similarity to a frame: the cosine between their embeddings, -1 to 1."""

    sentence: str
    similarity: float


def stock_sentences() -> tuple[str, ...]:
    """Plain sentences on what a home may show: a thing on a side, a doorway, a room."""
    things = [f"a {thing} {side}" for thing in _THINGS for side in _SIDES]
    return (*things, *(f"a {room}" for room in _ROOMS), "the way ahead is blocked", "the way ahead is clear")


def nearest(
    image_encoder: ClipImageEncoder,
    text_encoder: ClipTextEncoder,
    frame: NDArray[np.uint8],
    count: int = 5,
    sentences: Sequence[str] | None = None,
) -> list[Near]:
    """The `count` sentences nearest to a frame (H, W, 3) uint8, the nearest first; by default of `stock_sentences`.

    Raises ValueError for encoders of different embedding spaces.
    """
    if image_encoder.space != text_encoder.space:
        raise ValueError(f"embeddings of {image_encoder.space} and {text_encoder.space} cannot be compared")
    choices = stock_sentences() if sentences is None else tuple(sentences)
    image = image_encoder.encode(torch.from_numpy(np.array(frame))[None]).numpy()[0]
    similarities = text_encoder.encode(choices) @ image
    order = np.argsort(-similarities, kind="stable")[:count]
    return [Near(choices[index], float(similarities[index])) for index in order.tolist()]
