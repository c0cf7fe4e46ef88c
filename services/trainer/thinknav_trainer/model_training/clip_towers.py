"""The two halves of the small CLIP as they are trained, and how they become the weights that ship.

Training keeps batch norms, skips and word dropout apart; shipping folds them into plain products.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from thinknav_models.clip.image import CELLS, STEM_KERNEL, STEM_PADDING, STEM_STRIDE
from thinknav_models.clip.text import DIMENSION, NORM_EPSILON
from thinknav_models.clip.tokens import MAX_TOKENS, word_parts

STEM_CHANNELS = 32
LAYERS = ((64, 2), (64, 1), (128, 2), (128, 1), (192, 2))  # channels and stride of each
CELL_FEATURES = 64  # of each of the 4 x 4 cells

TEXT_WIDTH = 96
TEXT_HEADS = 4
TEXT_LAYERS = 2
TEXT_BUCKETS = 2048
WORD_DROPOUT = 0.1  # words that are read by their parts alone, as strangers are

PADDING = -1
PIXEL_RANGE = 255.0

Tensors = dict[str, NDArray[np.float32]]


class Convolution(nn.Module):
    """Convolution, batch norm, a skip where the shapes allow it, ReLU."""

    def __init__(self, inputs: int, outputs: int, stride: int, kernel: int = 3, padding: int = 1) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(inputs, outputs, kernel, stride, padding, bias=False)
        self.norm = nn.BatchNorm2d(outputs)
        self.skips = inputs == outputs and stride == 1

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = self.norm(self.convolution(x))
        return functional.relu(y + x if self.skips else y)

    def folded(self) -> tuple[Tensor, Tensor]:
        """Weight and bias of the one convolution that does the same before the ReLU."""
        variance, mean = self.norm.running_var, self.norm.running_mean
        assert variance is not None
        assert mean is not None
        scale = self.norm.weight * (variance + self.norm.eps).rsqrt()
        weight = self.convolution.weight * scale[:, None, None, None]
        bias = self.norm.bias - mean * scale
        if self.skips:
            weight = weight + nn.init.dirac_(torch.empty_like(weight))
        return weight, bias


class Convolutions(nn.Module):
    """Frames (N, H, W, 3) uint8 or float to channels of cells (N, C, 4, 4). layers: channels and stride of each."""

    def __init__(self, stem: int, layers: Sequence[tuple[int, int]]) -> None:
        super().__init__()
        self.sizes = tuple(layers)
        self.channels = stem
        built = [Convolution(3, stem, STEM_STRIDE, STEM_KERNEL, STEM_PADDING)]
        for outputs, stride in layers:
            built.append(Convolution(self.channels, outputs, stride))
            self.channels = outputs
        self.layers = nn.ModuleList(built)

    def forward(self, frames: Tensor) -> Tensor:
        # Half as many bits hold a pixel's 256 values as well.
        x = frames.to(torch.get_autocast_dtype("cpu") if torch.is_autocast_enabled("cpu") else torch.float32)
        x = x.mul_(1 / PIXEL_RANGE).permute(0, 3, 1, 2)
        for layer in self.layers:
            x = layer(x)
        return x

    @torch.no_grad()
    def export(self) -> Tensors:
        """The tensors of `ClipImageEncoder`'s convolutions but the last."""
        tensors: Tensors = {}
        for index, layer in enumerate(self.layers):
            assert isinstance(layer, Convolution)
            weight, bias = layer.folded()
            tensors[f"image.{index}.weight"] = (weight / PIXEL_RANGE if index == 0 else weight).numpy()
            tensors[f"image.{index}.bias"] = bias.numpy()
        return tensors


class ImageTower(nn.Module):
    """Frames (N, 128, 128, 3) uint8 or float to embeddings (N, 512), not yet of length 1."""

    def __init__(self) -> None:
        super().__init__()
        self.convolutions = Convolutions(STEM_CHANNELS, LAYERS)
        self.squeeze = nn.Conv2d(self.convolutions.channels, CELL_FEATURES, 1, bias=False)
        self.standardize = nn.BatchNorm2d(CELL_FEATURES, affine=False)
        self.projection = nn.Linear(CELL_FEATURES * CELLS * CELLS, DIMENSION)

    def forward(self, frames: Tensor) -> Tensor:
        x = self.convolutions(frames)
        embeddings: Tensor = self.projection(self.standardize(self.squeeze(x)).flatten(1))
        return embeddings

    @torch.no_grad()
    def export(self) -> tuple[dict[str, Any], Tensors]:
        """Configuration and tensors of `ClipImageEncoder`."""
        tensors = self.convolutions.export()
        variance, mean = self.standardize.running_var, self.standardize.running_mean
        assert variance is not None
        assert mean is not None
        scale = (variance + self.standardize.eps).rsqrt()
        tensors["image.squeeze.weight"] = (self.squeeze.weight * scale[:, None, None, None]).numpy()
        tensors["image.squeeze.bias"] = (-mean * scale).numpy()
        tensors["image.projection"] = self.projection.weight.T.numpy()
        tensors["image.offset"] = self.projection.bias.numpy()
        return {"layers": [list(layer) for layer in self.convolutions.sizes]}, tensors


class TextLayer(nn.Module):
    """A pre-norm transformer layer; the norms' gains are part of the products after them."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.qkv = nn.Linear(width, 3 * width)
        self.mix = nn.Linear(width, width, bias=False)
        self.up = nn.Linear(width, 2 * width)
        self.down = nn.Linear(2 * width, width, bias=False)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        count, length, width = x.shape
        q, k, v = self.qkv(normalized(x)).view(count, length, 3, TEXT_HEADS, -1).permute(2, 0, 3, 1, 4)
        scores = (q @ k.transpose(-1, -2)).float() / math.sqrt(q.shape[-1])
        mixed = scores.masked_fill(~mask[:, None, None, :], -torch.inf).softmax(dim=-1).to(v.dtype) @ v
        x = x + self.mix(mixed.transpose(1, 2).reshape(count, length, width))
        output: Tensor = x + self.down(functional.relu(self.up(normalized(x))))
        return output


class TextTower(nn.Module):
    """Word numbers (N, L) int64, PADDING after a text's end, to embeddings (N, 512), not yet of length 1."""

    def __init__(self, vocabulary: Sequence[str]) -> None:
        super().__init__()
        self.vocabulary = tuple(vocabulary)
        self.words = nn.Parameter(0.5 * torch.randn(len(vocabulary), TEXT_WIDTH))
        self.parts = nn.Parameter(0.5 * torch.randn(TEXT_BUCKETS, TEXT_WIDTH))
        self.positions = nn.Parameter(0.1 * torch.randn(MAX_TOKENS, TEXT_WIDTH))
        self.layers = nn.ModuleList(TextLayer(TEXT_WIDTH) for _ in range(TEXT_LAYERS))
        self.projection = nn.Linear(TEXT_WIDTH, DIMENSION, bias=False)
        parts = [word_parts(word.encode(), TEXT_BUCKETS) for word in self.vocabulary]
        self._part_numbers = torch.tensor([number for numbers in parts for number in numbers])
        self._part_offsets = torch.tensor(np.cumsum([0, *map(len, parts)])[:-1])

    def forward(self, numbers: Tensor) -> Tensor:
        mask = numbers != PADDING
        spelt = functional.embedding_bag(self._part_numbers, self.parts, self._part_offsets, mode="mean")
        place = numbers.clamp(min=0)
        x = functional.embedding(place, self.words)
        if self.training:
            dropped = torch.rand(numbers.shape) < WORD_DROPOUT
            x = torch.where(dropped[..., None], functional.embedding(place, spelt), x)
        x = x + self.positions[: numbers.shape[1]]
        for layer in self.layers:
            x = layer(x, mask)
        mean = (x * mask[..., None]).sum(1) / mask.sum(1, keepdim=True)
        embeddings: Tensor = self.projection(normalized(mean))
        return embeddings

    @torch.no_grad()
    def export(self) -> tuple[dict[str, Any], Tensors]:
        """Configuration and tensors of `TextNetwork`."""
        tensors = {"text.words": self.words.numpy(), "text.parts": self.parts.numpy()}
        tensors["text.positions"] = self.positions.numpy()
        tensors["text.projection"] = self.projection.weight.T.numpy()
        for index, layer in enumerate(self.layers):
            assert isinstance(layer, TextLayer)
            for name in ("qkv", "mix", "up", "down"):
                linear = getattr(layer, name)
                tensors[f"text.{index}.{name}"] = linear.weight.T.numpy()
                if linear.bias is not None:
                    tensors[f"text.{index}.{name}_bias"] = linear.bias.numpy()
        config = {"words": list(self.vocabulary), "heads": TEXT_HEADS, "layers": TEXT_LAYERS, "buckets": TEXT_BUCKETS}
        return config, tensors


def normalized(x: Tensor) -> Tensor:
    """Each vector over its root mean square."""
    return functional.rms_norm(x, x.shape[-1:], eps=NORM_EPSILON)
