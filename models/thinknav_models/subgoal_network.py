"""The network of the subgoal VLM: image tokens of one to five views, and a decoder that attends to them.

A view goes through a small residual convolutional trunk to an 8x8 grid of features. The present view keeps all 64 of
them; earlier views are pooled to 4x4 and carry their heading. The decoder's first token is the goal (the mean of its
words) and the mode; its answer to it is the direction. Knows no words and no homes.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval

IMAGE_SIZE = 128
GRID = 8  # the trunk's features
POOLED = 4  # those of an earlier view
MODES = ("subgoal", "plan")
# Training's extra lessons: cos and sin of the way's bearing, log distance, goal in view; how far each of the grid's
# cells is, and which of six goals it shows.
WAY, CELL = 4, 7


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes. vocabulary: tokens. channels: of the trunk's three resolutions. width, heads, layers: the decoder's.

    max_tokens: of the longest answer, a plan.
    """

    vocabulary: int
    channels: tuple[int, int, int] = (32, 64, 128)
    width: int = 128
    heads: int = 4
    layers: int = 3
    max_tokens: int = 64


@dataclass(frozen=True)
class Memory:
    """What the decoder attends to, for N questions.

    keys, values: one for each layer, (N, heads, places, width / heads). hidden: (N, 1, 1, places) bool, what is absent;
    None where nothing is.
    """

    keys: list[Tensor]
    values: list[Tensor]
    hidden: Tensor | None


def _convolution(inputs: int, outputs: int, size: int, stride: int, padding: int) -> list[nn.Module]:
    """A convolution and its normalisation, without which a trunk this small hardly learns."""
    return [nn.Conv2d(inputs, outputs, size, stride, padding, bias=False), nn.BatchNorm2d(outputs)]


class ResidualBlock(nn.Module):
    """Two convolutions whose sum with the input starts as the input."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        last = nn.BatchNorm2d(channels)
        nn.init.zeros_(last.weight)
        self.layers = nn.Sequential(
            *_convolution(channels, channels, 3, 1, 1),
            nn.ReLU(inplace=True),
            nn.Conv2d(channels, channels, 3, padding=1, bias=False),
            last,
        )

    def forward(self, features: Tensor) -> Tensor:
        out: Tensor = functional.relu_(features + self.layers(features))
        return out


class ViewTrunk(nn.Module):
    """Views to feature grids."""

    def __init__(self, channels: tuple[int, int, int]) -> None:
        super().__init__()
        low, middle, high = channels
        self.layers = nn.Sequential(
            *_convolution(3, low, 4, 4, 0),
            nn.ReLU(inplace=True),
            *_convolution(low, middle, 3, 2, 1),
            nn.ReLU(inplace=True),
            ResidualBlock(middle),
            *_convolution(middle, high, 3, 2, 1),
            nn.ReLU(inplace=True),
            ResidualBlock(high),
            ResidualBlock(high),
        )
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, views: Tensor) -> Tensor:
        """(B, 128, 128, 3) of 0 to 255 to (B, channels, 8, 8)."""
        dtype = torch.get_autocast_dtype("cpu") if torch.is_autocast_enabled("cpu") else next(self.parameters()).dtype
        images = views.permute(0, 3, 1, 2).to(
            dtype
        )  # exact in half precision too, as is what follows but for the scale
        scaled = (images - 127.5).div_(255).contiguous(memory_format=torch.channels_last)
        features: Tensor = self.layers(scaled)
        return features


def fold_normalisation(trunk: ViewTrunk) -> None:
    """Put each normalisation into the convolution before it, in place: the same answers, sooner. For a taught trunk."""
    for module in list(trunk.modules()):
        if isinstance(module, nn.Sequential):
            for index in range(1, len(module)):
                before, norm = module[index - 1], module[index]
                if isinstance(before, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
                    module[index - 1], module[index] = fuse_conv_bn_eval(before, norm), nn.Identity()


class DecoderLayer(nn.Module):
    """Attends to the tokens so far, then to the image tokens, then thinks."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.self_norm, self.cross_norm, self.mlp_norm = (nn.LayerNorm(width) for _ in range(3))
        self.self_qkv = nn.Linear(width, 3 * width)
        self.self_out = nn.Linear(width, width)
        self.cross_q = nn.Linear(width, width)
        self.cross_kv = nn.Linear(width, 2 * width)
        self.cross_out = nn.Linear(width, width)
        self.mlp = nn.Sequential(nn.Linear(width, 3 * width), nn.GELU(), nn.Linear(3 * width, width))

    def split(self, tokens: Tensor, parts: int) -> list[Tensor]:
        """(B, L, parts x width) to `parts` tensors (B, heads, L, width / heads)."""
        batch, length, _ = tokens.shape
        return list(tokens.view(batch, length, parts, self.heads, -1).permute(2, 0, 3, 1, 4))

    def attend_to_tokens(self, x: Tensor, past: tuple[Tensor, Tensor] | None) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        """Causal self-attention of new tokens (B, L, width) after those whose keys and values are `past`."""
        query, key, value = self.split(self.self_qkv(self.self_norm(x)), 3)
        if past is not None:
            key, value = torch.cat([past[0], key], dim=2), torch.cat([past[1], value], dim=2)
        length = x.shape[1]
        future = None  # nothing lies after a single token
        if length > 1:
            future = torch.ones(length, key.shape[2], dtype=torch.bool).triu(key.shape[2] - length + 1)
        return x + self.self_out(_joined(_attention(query, key, value, future))), (key, value)

    def attend_to_views(self, x: Tensor, key: Tensor, value: Tensor, hidden: Tensor | None) -> Tensor:
        """Cross-attention of tokens (N x G, L, width) to the memory of N questions, G goals each."""
        questions, (rows, length, width) = len(key), x.shape
        (query,) = self.split(self.cross_q(self.cross_norm(x)).view(questions, -1, width), 1)
        x = x + self.cross_out(_joined(_attention(query, key, value, hidden))).view(rows, length, width)
        mlp: Tensor = self.mlp(self.mlp_norm(x))
        return x + mlp


def _attention(query: Tensor, key: Tensor, value: Tensor, hidden: Tensor | None) -> Tensor:
    """Written out: for a few queries of size 32, torch's fused attention takes three times as long on a CPU."""
    scores = query @ key.transpose(-1, -2) * (key.shape[-1] ** -0.5)
    if hidden is not None:
        scores = scores.masked_fill(hidden, -math.inf)
    attended: Tensor = scores.softmax(dim=-1).to(value.dtype) @ value
    return attended


def _joined(attended: Tensor) -> Tensor:
    """(B, heads, L, size) to (B, L, heads x size)."""
    return attended.transpose(1, 2).flatten(2)


class SubgoalNetwork(nn.Module):
    """Views, goal and mode to the distribution of the next token."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        width = config.width
        self.config = config
        self.trunk = ViewTrunk(config.channels)
        self.present = nn.Linear(config.channels[2], width)
        self.earlier = nn.Linear(config.channels[2], width)
        self.place = nn.Parameter(torch.randn(GRID * GRID, width) * 0.02)
        self.earlier_place = nn.Parameter(torch.randn(POOLED * POOLED, width) * 0.02)
        self.heading = nn.Linear(4, width)
        self.memory_norm = nn.LayerNorm(width)
        self.words = nn.Embedding(config.vocabulary, width)
        self.goal_words = nn.EmbeddingBag(config.vocabulary, width, mode="mean")
        self.modes = nn.Embedding(len(MODES), width)
        self.positions = nn.Parameter(torch.randn(config.max_tokens, width) * 0.02)
        self.layers = nn.ModuleList([DecoderLayer(width, config.heads) for _ in range(config.layers)])
        self.norm = nn.LayerNorm(width)
        self.next_word = nn.Linear(width, config.vocabulary)
        self.way = nn.Linear(width, WAY)
        self.surroundings = nn.Conv2d(config.channels[2], CELL, 1)
        for embedding in (self.words, self.goal_words, self.modes):
            nn.init.normal_(embedding.weight, std=0.1)

    def remember(self, features: Tensor, views: Tensor, headings: Tensor) -> Memory:
        """What the decoder will attend to, for N questions about F views.

        features: (F, C, 8, 8), the trunk's. views: (N, 1 + K) int64, the present view and earlier ones, -1 for none.
        headings: (N, K) radians, of the earlier ones relative to the present one.
        """
        questions, count = views.shape[0], views.shape[1] - 1
        present = self.present(features.flatten(2).transpose(1, 2)) + self.place
        tokens = present[views[:, 0]]
        hidden = None
        if count:
            pooled = functional.adaptive_avg_pool2d(features, POOLED).flatten(2).transpose(1, 2)
            earlier = (self.earlier(pooled) + self.earlier_place)[views[:, 1:].clamp(min=0)]
            turned = torch.stack([headings.cos(), headings.sin(), (2 * headings).cos(), (2 * headings).sin()], dim=-1)
            earlier = earlier + self.heading(turned.to(earlier.dtype))[:, :, None]
            tokens = torch.cat([tokens, earlier.flatten(1, 2)], dim=1)
            missing = (views[:, 1:] < 0)[:, :, None].expand(-1, -1, POOLED * POOLED)
            absent = torch.cat([torch.zeros(questions, GRID * GRID, dtype=torch.bool), missing.flatten(1)], dim=1)
            hidden = absent[:, None, None]
        tokens = self.memory_norm(tokens)
        pairs = [layer.split(layer.cross_kv(tokens), 2) for layer in self.decoder_layers]
        # Laid out anew once, and not again for every word.
        keys, values = ([part.contiguous() for part in parts] for parts in zip(*pairs, strict=True))
        return Memory(keys, values, hidden)

    @property
    def decoder_layers(self) -> list[DecoderLayer]:
        """The decoder, first layer first."""
        return [layer for layer in self.layers if isinstance(layer, DecoderLayer)]

    def first_token(self, goals: Tensor, lengths: Tensor, modes: Tensor) -> Tensor:
        """The decoder's first input (B, 1, width): goals (words of all goals in a row,), lengths (B,), modes (B,)."""
        starts = functional.pad(lengths.cumsum(0)[:-1], (1, 0))
        first: Tensor = self.goal_words(goals, starts) + self.modes(modes)
        return first[:, None]

    def decode(
        self, first: Tensor, tokens: Tensor, memory: Memory, past: list[tuple[Tensor, Tensor]] | None = None
    ) -> tuple[Tensor, list[tuple[Tensor, Tensor]]]:
        """Hidden states (B, L, width) of new tokens, and what the next call takes as `past`.

        Without a past, `first` (B, 1, width) goes before the tokens (B, L - 1); with one, it is not used. B is a
        multiple of the memory's N: its questions in order, each with as many goals.
        """
        x = self.words(tokens)
        before = 0 if past is None else past[0][0].shape[2]
        if past is None:
            x = torch.cat([first, x.to(first.dtype)], dim=1)
        x = x + self.positions[before : before + x.shape[1]]
        seen = []
        for number, layer in enumerate(self.decoder_layers):
            x, keys_values = layer.attend_to_tokens(x, None if past is None else past[number])
            x = layer.attend_to_views(x, memory.keys[number], memory.values[number], memory.hidden)
            seen.append(keys_values)
        return self.norm(x), seen

    def logits(self, hidden: Tensor) -> Tensor:
        """Of the next token, float32."""
        logits: Tensor = self.next_word(hidden)
        return logits.float()


def way_targets(bearing: Tensor, distance: Tensor, in_view: Tensor) -> Tensor:
    """What the `way` head should say (..., 4), of radians, metres and bool, each (...)."""
    return torch.stack([bearing.cos(), bearing.sin(), torch.log1p(distance) / math.log(10), in_view.float()], dim=-1)
