"""A ResNet50 that learns to see RGB-D: Habitat-Baselines' encoder for its DD-PPO, and so that of the paper's baseline.

Half as wide as He et al.'s (32 planes), with group normalisation, whose result does not depend on the rest of the
batch, on pictures of half the size; its last channels are compressed to some 2,048 numbers. Random weights: the ones
that others have trained on Gibson are not shipped.
"""

import math
from collections.abc import Mapping

from torch import Tensor, nn
from torch.nn import functional

from thinknav_trainer.vision import RgbdVision

PLANES = 32
GROUPS = PLANES // 2
BLOCKS = (3, 4, 6, 3)  # of the four stages of a ResNet50
EXPANSION = 4
SHRINKS = 2 * 32  # by halving the picture, and by the ResNet
FLAT_SIZE = 2048  # about as many numbers are left of a picture before the last layer


class ResNetVision(RgbdVision):
    """RGB-D (B, H, W, 4) through a ResNet50 to features."""

    def __init__(self, height: int, width: int, out_features: int) -> None:
        super().__init__()
        cells = math.ceil(height / SHRINKS) * math.ceil(width / SHRINKS)
        channels = round(FLAT_SIZE / cells)
        stages: list[nn.Module] = []
        planes_in = PLANES
        for stage, blocks in enumerate(BLOCKS):
            planes = PLANES * 2**stage
            for block in range(blocks):
                stages.append(Bottleneck(planes_in, planes, stride=2 if stage and not block else 1))
                planes_in = planes * EXPANSION
        self.resnet = nn.Sequential(
            nn.Conv2d(4, PLANES, kernel_size=7, stride=2, padding=3, bias=False),
            nn.GroupNorm(GROUPS, PLANES),
            nn.ReLU(),
            nn.MaxPool2d(kernel_size=3, stride=2, padding=1),
            *stages,
        )
        self.compression = nn.Sequential(
            nn.Conv2d(planes_in, channels, kernel_size=3, padding=1, bias=False),
            nn.GroupNorm(1, channels),
            nn.ReLU(),
            nn.Flatten(),
        )
        self.linear = nn.Sequential(nn.Linear(channels * cells, out_features), nn.ReLU())
        _initialize(self)

    def forward(self, prepared: Mapping[str, Tensor]) -> Tensor:
        halved = functional.avg_pool2d(prepared["image"].permute(0, 3, 1, 2), 2, ceil_mode=True)
        features: Tensor = self.linear(self.compression(self.resnet(halved)))
        return features


class Bottleneck(nn.Module):
    """A residual block of three convolutions: fewer channels, what is around, four times as many channels."""

    def __init__(self, planes_in: int, planes: int, stride: int) -> None:
        super().__init__()
        planes_out = planes * EXPANSION
        self.convolutions = nn.Sequential(
            nn.Conv2d(planes_in, planes, kernel_size=1, bias=False),
            nn.GroupNorm(GROUPS, planes),
            nn.ReLU(),
            nn.Conv2d(planes, planes, kernel_size=3, stride=stride, padding=1, bias=False),
            nn.GroupNorm(GROUPS, planes),
            nn.ReLU(),
            nn.Conv2d(planes, planes_out, kernel_size=1, bias=False),
            nn.GroupNorm(GROUPS, planes_out),
        )
        self.shortcut: nn.Module = nn.Identity()
        if stride > 1 or planes_in != planes_out:
            self.shortcut = nn.Sequential(
                nn.Conv2d(planes_in, planes_out, kernel_size=1, stride=stride, bias=False),
                nn.GroupNorm(GROUPS, planes_out),
            )

    def forward(self, image: Tensor) -> Tensor:
        return functional.relu(self.convolutions(image) + self.shortcut(image))


def _initialize(module: nn.Module) -> None:
    """He's weights (2015), no biases."""
    for layer in module.modules():
        if isinstance(layer, nn.Conv2d | nn.Linear):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        if isinstance(layer, nn.Linear):
            nn.init.zeros_(layer.bias)
