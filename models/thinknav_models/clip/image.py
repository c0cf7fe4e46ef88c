"""The image half of the small CLIP: some convolutions and a projection, on a CPU, in bfloat16 where that is fast.

Besides the embedding it gives the features that the embedding is made of. They keep their place in the picture, 4 by 4,
which the embedding blurs and a robot steers by.

There are two: the one that was trained with the text half, on frames of 128 by 128, and its pupil, the small one, which
gives much the same features of frames of 64 by 64, in a third of the time.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from thinknav_models.bfloat16 import bfloat16_is_fast
from thinknav_models.clip.text import CLIP_KIND, CLIP_WEIGHTS, SPACE_NAME
from thinknav_models.text_encoder import EmbeddingSpace
from thinknav_models.weights import SHIPPED, Weights, WeightsError, load_weights

FRAME_SIZE = 128  # pixels, each way, unless the weights say otherwise; frames of other sizes are resampled
CELLS = 4  # of the feature grid, each way

STEM_KERNEL, STEM_STRIDE, STEM_PADDING = 8, 4, 2

SMALL_KIND = "clip-small-image"
SMALL_WEIGHTS = SHIPPED / "clip_small.safetensors"

_CHUNK = 32  # frames at once: what lies between layers then stays in the processor's cache


class ClipImageEncoder:
    """Frames to features and embeddings. Its weights never change; any thread may call it.

    space: of its embeddings. revision: of its own weights. frame_size: pixels, each way, that it sees.
    """

    def __init__(self, weights: Weights, space: EmbeddingSpace, dtype: torch.dtype) -> None:
        self.space = space
        self.revision = weights.revision
        config: Mapping[str, Any] = weights.config["image"]
        self.frame_size = int(config.get("frame_size", FRAME_SIZE))
        self._strides = [STEM_STRIDE, *(int(stride) for _, stride in config["layers"]), 1]
        names = [*(f"image.{index}" for index in range(len(self._strides) - 1)), "image.squeeze"]
        self._kernels = [self._tensor(weights, f"{name}.weight", dtype) for name in names]
        self._biases = [self._tensor(weights, f"{name}.bias", dtype) for name in names]
        self._projection = self._tensor(weights, "image.projection", torch.float32)
        self._offset = self._tensor(weights, "image.offset", torch.float32)
        self._dtype = dtype
        self.feature_size = self._projection.shape[0]

    @classmethod
    def load(cls, path: Path = CLIP_WEIGHTS, dtype: torch.dtype | None = None) -> "ClipImageEncoder":
        """The encoder in a file of weights, by default the shipped one. Raises WeightsError.

        dtype: torch.float32 or torch.bfloat16, by default the faster one here.
        """
        weights = load_weights(path, CLIP_KIND)
        return cls(weights, EmbeddingSpace(SPACE_NAME, weights.revision), dtype or _faster_dtype())

    @classmethod
    def load_small(
        cls, path: Path = SMALL_WEIGHTS, of: Path = CLIP_WEIGHTS, dtype: torch.dtype | None = None
    ) -> "ClipImageEncoder":
        """The small encoder in a file, by default the shipped one, and the CLIP that it is a pupil `of`.

        Raises WeightsError, also where it is the pupil of another CLIP.
        """
        weights = load_weights(path, SMALL_KIND)
        space = EmbeddingSpace(SPACE_NAME, load_weights(of, CLIP_KIND).revision)
        if weights.config["space"] != str(space):
            raise WeightsError(
                f"{path} is the pupil of {weights.config['space']}, and {of} holds {space}; "
                "teach it anew: thinknav models train clip-small"
            )
        return cls(weights, space, dtype or _faster_dtype())

    @torch.no_grad()
    def features(self, frames: Tensor) -> Tensor:
        """Frames (N, H, W, 3) uint8 to (N, feature_size) float16: channels of 4 by 4 cells, row by row.

        Each channel has about mean 0 and deviation 1 over the homes that the encoder was trained in.
        """
        if not len(frames):
            return torch.empty((0, self.feature_size), dtype=torch.float16)
        with torch.autocast("cpu", enabled=False):
            return torch.cat([self._features(chunk) for chunk in torch.split(frames, _CHUNK)])

    @torch.no_grad()
    def embed(self, features: Tensor) -> Tensor:
        """Features (N, feature_size) to embeddings (N, 512) float32, each of length 1."""
        with torch.autocast("cpu", enabled=False):
            return functional.normalize(features.float() @ self._projection + self._offset)

    def encode(self, frames: Tensor) -> Tensor:
        """Frames (N, H, W, 3) uint8 to embeddings (N, 512) float32, each of length 1."""
        return self.embed(self.features(frames))

    def _features(self, frames: Tensor) -> Tensor:
        x = resampled(frames, self.frame_size).to(self._dtype)
        last = len(self._kernels) - 1
        for index, (kernel, bias) in enumerate(zip(self._kernels, self._biases, strict=True)):
            padding = STEM_PADDING if index == 0 else kernel.shape[2] // 2
            x = functional.conv2d(x, kernel, bias, self._strides[index], padding)
            if index < last:
                x = x.relu_()
        # Half precision ends at 65,504; features lie within some tens.
        return x.flatten(1).to(torch.float16)

    @staticmethod
    def _tensor(weights: Weights, name: str, dtype: torch.dtype) -> Tensor:
        tensor = torch.from_numpy(weights.tensors[name]).to(dtype)
        return tensor.contiguous(memory_format=torch.channels_last) if tensor.ndim == 4 else tensor


def resampled(frames: Tensor, size: int = FRAME_SIZE) -> Tensor:
    """Frames (N, H, W, 3) uint8 as (N, 3, size, size) uint8, averaged where they shrink."""
    pixels = frames.permute(0, 3, 1, 2)
    if tuple(pixels.shape[2:]) == (size, size):
        return pixels
    shrinks = max(pixels.shape[2:]) > size
    return functional.interpolate(pixels, (size, size), mode="bilinear", antialias=shrinks)


def _faster_dtype() -> torch.dtype:
    return torch.bfloat16 if bfloat16_is_fast() else torch.float32
