"""What N agents looked at last, and what came of it: who has the same pictures before it again is not looked for twice.

Who thinks or bumps stands where it stood, and an image encoder is the dearest part of a step. Knows nothing of actions.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from thinknav_trainer.vision import PICTURES, Vision

Arrays = Mapping[str, NDArray[Any]]


class Glances:
    """Looks for N agents. What a look gives is remembered to the bit: batches of another size differ in their last."""

    def __init__(self, vision: Vision, count: int) -> None:
        self._vision = vision
        self._count = count
        self._pictures: dict[str, NDArray[Any]] = {}  # by name, (N, ...)
        self._looked: dict[str, NDArray[Any]] = {}  # what was made of them, (N, ...)
        self._known = np.zeros(count, np.bool_)

    def look(self, observations: Arrays, agents: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """As `Vision.look`, of what different agents (n,) observe (n, ...)."""
        if any(name not in observations for name in PICTURES):
            return dict(observations)
        pictures = {name: observations[name] for name in PICTURES}
        again = self._same(pictures, agents)
        if not again.any():
            looked = self._vision_of(observations)
            if PICTURES[0] not in looked:
                self._remember(pictures, {name: looked[name] for name in looked if name not in observations}, agents)
            return looked
        news = ~again
        if news.any():
            fresh = self._vision_of({name: values[news] for name, values in pictures.items()})
            self._remember({name: values[news] for name, values in pictures.items()}, fresh, agents[news])
        kept = {name: values for name, values in observations.items() if name not in PICTURES}
        return kept | {name: values[agents] for name, values in self._looked.items()}

    def _vision_of(self, observations: Arrays) -> dict[str, NDArray[Any]]:
        tensors: dict[str, Tensor] = {name: torch.from_numpy(values) for name, values in observations.items()}
        return {name: values.numpy() for name, values in self._vision.look(tensors).items()}

    def _same(self, pictures: Arrays, agents: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(n,) who sees what it saw."""
        same = self._known[agents]
        for row in np.flatnonzero(same):
            seen = int(agents[row])
            same[row] = all(
                np.array_equal(values[row], self._pictures[name][seen]) for name, values in pictures.items()
            )
        return same

    def _remember(self, pictures: Arrays, looked: Arrays, agents: NDArray[np.int64]) -> None:
        for store, news in ((self._pictures, pictures), (self._looked, looked)):
            for name, values in news.items():
                if name not in store:
                    store[name] = np.zeros((self._count, *values.shape[1:]), values.dtype)
                store[name][agents] = values
        self._known[agents] = True

    def state_dict(self) -> dict[str, Any]:
        """All that it remembers."""
        return {"pictures": dict(self._pictures), "looked": dict(self._looked), "known": self._known.copy()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Remember what `state_dict` gave."""
        self._pictures, self._looked = dict(state["pictures"]), dict(state["looked"])
        self._known = state["known"].copy()
