"""CLIP's text encoder (ViT-B/32 by default) through transformers: texts to 512 numbers."""

import threading
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from transformers import AutoTokenizer, CLIPTextModelWithProjection
from transformers.utils import logging as transformers_logging

from thinknav_models import EmbeddingSpace
from thinknav_server.planners.snapshot import find_snapshot, model_name, revision_of

_LONGEST_BATCH = 256


class ClipTextEncoder:
    """Any thread may call it. model: a folder, or a name on the Hugging Face hub. Raises ValueError."""

    def __init__(self, model: str) -> None:
        transformers_logging.disable_progress_bar()
        snapshot = find_snapshot(model)
        try:
            self._tokenizer = AutoTokenizer.from_pretrained(snapshot)
            self._model = CLIPTextModelWithProjection.from_pretrained(snapshot).eval()
        except (OSError, ValueError, KeyError) as error:
            raise ValueError(f"{snapshot} holds no CLIP text encoder that can be used: {error}") from error
        self._lock = threading.Lock()  # tokenizers are not made to be shared
        self._space = EmbeddingSpace(f"clip/{model_name(model)}", revision_of(snapshot))

    @property
    def space(self) -> EmbeddingSpace:
        return self._space

    @property
    def dimension(self) -> int:
        dimension: int = self._model.config.projection_dim
        return dimension

    def encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """The embeddings (N, dimension) float32, each of length 1, of N texts; what is over 77 tokens is cut off."""
        parts = [self._encode(texts[start : start + _LONGEST_BATCH]) for start in range(0, len(texts), _LONGEST_BATCH)]
        return np.concatenate(parts) if parts else np.empty((0, self.dimension), np.float32)

    @torch.inference_mode()
    def _encode(self, texts: Sequence[str]) -> NDArray[np.float32]:
        with self._lock:
            length = self._model.config.max_position_embeddings
            tokens = self._tokenizer(list(texts), padding=True, truncation=True, max_length=length, return_tensors="pt")
            embeddings = self._model(**tokens).text_embeds
        unit: NDArray[np.float32] = torch.nn.functional.normalize(embeddings, dim=-1).float().numpy()
        return unit
