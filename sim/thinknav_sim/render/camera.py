"""A pinhole camera on an agent, like that of Habitat's HM3D ObjectNav. Knows nothing of renderers."""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Camera:
    """A camera that looks straight ahead.

    width, height: pixels. hfov: horizontal field of view in degrees; pixels are square.
    elevation: metres above the agent's feet. depth_range: None for depth pictures in metres; otherwise they read 0 at
    its first number of metres and nearer, or where there is nothing, and 1 at its second and farther.
    """

    width: int = 256
    height: int = 256
    hfov: float = 79.0
    elevation: float = 0.88
    depth_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a camera has at least one pixel each way, not {self.width}x{self.height}")
        if not 1.0 <= self.hfov <= 170.0:
            raise ValueError(f"hfov must lie between 1 and 170 degrees, not {self.hfov}")
        with np.errstate(over="ignore"):
            low, high, _ = self.depth_scale
        if self.depth_range is not None and not 0 <= low < high < math.inf:
            raise ValueError(f"a depth range goes from 0 m or more to more than that, not {self.depth_range}")

    @property
    def depth_scale(self) -> tuple[np.float32, np.float32, np.float32]:
        """low, high and span: a depth of d metres reads (clip(d, low, high) - low) / span."""
        if self.depth_range is None:
            return np.float32(0), np.float32(np.inf), np.float32(1)
        low, high = np.float32(self.depth_range[0]), np.float32(self.depth_range[1])
        return low, high, high - low

    @property
    def focal_length(self) -> float:
        """Distance of the image plane in pixels."""
        return self.width / 2 / math.tan(math.radians(self.hfov) / 2)
