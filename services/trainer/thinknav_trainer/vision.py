"""How a policy sees: what it keeps of a step's pictures, and the features that it makes of them.

Two ways: convolutions that learn on RGB-D (three, or the ResNet50 of `vision_resnet`), or the embedded CLIP (or its
pupil, the small one), which has learnt already and is asked once a step, with a small layer that learns on depth alone.
Knows nothing of what the features are for.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.nn import functional

from thinknav_models.clip.image import ClipImageEncoder
from thinknav_trainer.config import PolicyConfig
from thinknav_trainer.errors import UserError

PICTURES = ("rgb", "depth")
COARSE_DEPTH = 32  # pixels, each way: enough to see what is in the way
PATCH = 8  # of them, each way: as many patches as the CLIP's features have cells
PATCH_FEATURES = 32


class EmbeddingSpaceError(UserError):
    """Two sides that must share an embedding space do not; the message names both spaces and says what to do."""


class Vision(nn.Module, ABC):
    """Pictures to features: `look` once a step, `prepare` once a rollout, call it once an epoch.

    Called with what `prepare` gave, it returns features (B, visual_size).
    """

    @abstractmethod
    def look(self, observations: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Observations, rgb (B, H, W, 3) uint8 and depth (B, H, W, 1) float32 among them, as they are to be kept.

        Those that were looked at before are as they should be.
        """

    @abstractmethod
    def prepare(self, looked: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """What was kept, as the network takes it, in the precision in force."""


def make_vision(height: int, width: int, config: PolicyConfig) -> Vision:
    """The way of seeing that a configuration asks for. Raises WeightsError when the CLIP cannot be read."""
    if config.image_encoder == "clip":
        return ClipVision(ClipImageEncoder.load(), config.visual_size)
    if config.image_encoder == "clip-small":
        return ClipVision(ClipImageEncoder.load_small(), config.visual_size)
    if config.image_encoder == "resnet50":
        from thinknav_trainer.vision_resnet import ResNetVision  # which is made from what is here

        return ResNetVision(height, width, config.visual_size)
    return LearntVision(height, width, config.channels, config.visual_size)


class ClipVision(Vision):
    """The embedded CLIP's features of the RGB, and convolutions on a coarse depth image.

    It keeps features in place of RGB frames: an update then neither runs the CLIP nor holds the pictures. It steers by
    the 4 x 4 cells of features and not by the embedding that is made of them, which says what is there, and on which
    side, but hardly how the floor runs to it.
    """

    def __init__(self, encoder: ClipImageEncoder, out_features: int) -> None:
        super().__init__()
        self.depth = nn.Sequential(nn.Linear(PATCH**2, PATCH_FEATURES), nn.ReLU(), nn.Flatten())
        flat = PATCH_FEATURES * (COARSE_DEPTH // PATCH) ** 2
        self.linear = nn.Sequential(nn.Linear(encoder.feature_size + flat, out_features), nn.ReLU())
        self._encoder = encoder  # no module: neither trained nor saved with a policy
        _initialize(self)

    def look(self, observations: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """`sight` (B, feature_size) and `coarse_depth` (B, patches, pixels), both float16, in place of the pictures."""
        if "sight" in observations:
            return dict(observations)
        sight = self._encoder.features(observations["rgb"])
        depth = _patches(_coarse(observations["depth"][..., 0])).to(torch.float16)
        return _without_pictures(observations) | {"sight": sight, "coarse_depth": depth}

    def prepare(self, looked: Mapping[str, Tensor]) -> dict[str, Tensor]:
        dtype = _dtype_in_force()
        return dict(looked) | {
            "sight": looked["sight"].to(dtype),
            "coarse_depth": looked["coarse_depth"].to(dtype) - 0.5,
        }

    def forward(self, prepared: Mapping[str, Tensor]) -> Tensor:
        features: Tensor = self.linear(torch.cat([prepared["sight"], self.depth(prepared["coarse_depth"])], dim=1))
        return features

    def get_extra_state(self) -> dict[str, str]:
        """Which image encoder the weights have learnt to read."""
        return {"space": _named(self._encoder)}

    def set_extra_state(self, state: Mapping[str, str]) -> None:
        """Raises EmbeddingSpaceError for weights that have learnt to read another one."""
        if state["space"] != _named(self._encoder):
            raise EmbeddingSpaceError(
                f"the policy has learnt to see through the image encoder {state['space']}, and here is "
                f"{_named(self._encoder)}; use the ThinkNav that it was trained with"
            )


def _named(encoder: ClipImageEncoder) -> str:
    """The embedding space, and the image encoder's own weights where they are not those that made the space."""
    space = str(encoder.space)
    return space if encoder.space.revision == encoder.revision else f"{space}, small@{encoder.revision}"


class RgbdVision(Vision):
    """Sees RGB and depth as one image, and learns to see: an update needs the pictures, which are kept as they are."""

    def look(self, observations: Mapping[str, Tensor]) -> dict[str, Tensor]:
        return dict(observations)

    def prepare(self, looked: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """RGB and depth are joined to one centred `image` (B, H, W, 4)."""
        rgb, depth = looked["rgb"], looked["depth"]
        image = torch.empty((*rgb.shape[:3], 4), dtype=_dtype_in_force(), device=rgb.device)
        image[..., :3] = rgb
        image[..., :3] /= 255
        image[..., 3:] = depth
        image -= 0.5
        return _without_pictures(looked) | {"image": image}


class LearntVision(RgbdVision):
    """RGB-D to features: three convolutions, a third of the resolution that they were designed for."""

    def __init__(self, height: int, width: int, channels: tuple[int, int, int], out_features: int) -> None:
        super().__init__()
        first, second, third = channels
        self.convolutions = nn.Sequential(
            nn.Conv2d(4, first, kernel_size=8, stride=4, padding=2),
            nn.ReLU(),
            nn.Conv2d(first, second, kernel_size=4, stride=2, padding=1),
            nn.ReLU(),
            nn.Conv2d(second, third, kernel_size=3, stride=2, padding=1),
            nn.ReLU(),
            nn.Flatten(),
        )
        with torch.no_grad():
            flat = self.convolutions(torch.zeros(1, 4, height, width)).shape[1]
        self.linear = nn.Sequential(nn.Linear(flat, out_features), nn.ReLU())
        _initialize(self)

    def forward(self, prepared: Mapping[str, Tensor]) -> Tensor:
        features: Tensor = self.linear(self.convolutions(prepared["image"].permute(0, 3, 1, 2)))
        return features


def _coarse(depth: Tensor) -> Tensor:
    """Depth (B, H, W) averaged to (B, COARSE_DEPTH, COARSE_DEPTH)."""
    height, width = depth.shape[1:]
    if height % COARSE_DEPTH or width % COARSE_DEPTH:
        return functional.adaptive_avg_pool2d(depth, COARSE_DEPTH)
    # The same, by the faster of two ways.
    return functional.avg_pool2d(depth, (height // COARSE_DEPTH, width // COARSE_DEPTH))


def _patches(image: Tensor) -> Tensor:
    """Images (B, H, W) cut into squares, row by row: (B, patches, PATCH * PATCH)."""
    rows, columns = image.shape[1] // PATCH, image.shape[2] // PATCH
    return image.view(-1, rows, PATCH, columns, PATCH).transpose(2, 3).reshape(-1, rows * columns, PATCH**2)


def _without_pictures(observations: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {name: value for name, value in observations.items() if name not in PICTURES}


def _dtype_in_force() -> torch.dtype:
    """Of matrix products, wherever they are multiplied."""
    for kind in ("cpu", "cuda"):
        if torch.is_autocast_enabled(kind):
            return torch.get_autocast_dtype(kind)
    return torch.float32


def _initialize(module: nn.Module) -> None:
    """Orthogonal weights, no biases."""
    for name, parameter in module.named_parameters():
        if name.endswith("weight"):
            nn.init.orthogonal_(parameter, nn.init.calculate_gain("relu"))
        else:
            nn.init.zeros_(parameter)
