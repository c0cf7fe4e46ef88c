"""Frames to the patches that Qwen's vision encoders read: as transformers' own image processor makes them, but on the
model's device and without torchvision.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor
from transformers.models.qwen2_vl.image_processing_pil_qwen2_vl import smart_resize


class Patches(NamedTuple):
    """pixels: (patches, values of a patch) float32. grid: time, rows and columns of patches."""

    pixels: Tensor
    grid: tuple[int, int, int]


@dataclass(frozen=True)
class PatchMaker:
    """The settings of an image processor. Sizes are in pixels; mean and std are those of colours from 0 to 1."""

    patch: int
    merge: int
    frames: int
    min_pixels: int
    max_pixels: int
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    device: torch.device

    @classmethod
    def of(cls, snapshot: Path, device: torch.device) -> Self:
        """As a checkpoint's image processor is set. Raises ValueError without one."""
        settings = _settings(snapshot)
        size = settings.get("size", {})
        try:
            return cls(
                patch=settings["patch_size"],
                merge=settings["merge_size"],
                frames=settings["temporal_patch_size"],
                min_pixels=size.get("shortest_edge") or settings["min_pixels"],
                max_pixels=size.get("longest_edge") or settings["max_pixels"],
                mean=tuple(settings["image_mean"]),
                std=tuple(settings["image_std"]),
                device=device,
            )
        except KeyError as missing:
            raise ValueError(f"the settings of the image processor in {snapshot} lack {missing}") from None

    def cut(self, frame: NDArray[np.uint8]) -> tuple[Patches, int]:
        """The patches of a frame (H, W, 3), and how many image tokens they make."""
        height, width = smart_resize(
            *frame.shape[:2],
            factor=self.patch * self.merge,
            min_pixels=self.min_pixels,
            max_pixels=self.max_pixels,
        )
        if (height, width) != frame.shape[:2]:
            frame = np.asarray(Image.fromarray(frame).resize((width, height), Image.Resampling.BICUBIC))
        pixels = torch.tensor(frame).to(self.device).float() / 255
        mean, std = (torch.tensor(values, device=self.device) for values in (self.mean, self.std))
        pixels = ((pixels - mean) / std).permute(2, 0, 1)
        rows, columns = height // self.patch, width // self.patch
        m, p = self.merge, self.patch
        # Patches that are merged into one token stand beside each other; a still picture is repeated in time.
        patches = pixels.reshape(3, rows // m, m, p, columns // m, m, p).permute(1, 4, 2, 5, 0, 3, 6)
        patches = patches.unsqueeze(5).expand(*patches.shape[:5], self.frames, p, p)
        return Patches(patches.reshape(rows * columns, -1), (1, rows, columns)), rows * columns // m**2


def _settings(snapshot: Path) -> dict[str, Any]:
    """From the file of today's transformers, or the older one that Qwen's own checkpoints have."""
    for name, key in (("processor_config.json", "image_processor"), ("preprocessor_config.json", None)):
        path = snapshot / name
        if not path.exists():
            continue
        content = json.loads(path.read_text(encoding="utf-8"))
        settings: dict[str, Any] = content.get(key, {}) if key else content
        if settings:
            return settings
    raise ValueError(f"{snapshot} has no settings of an image processor (preprocessor_config.json)")
