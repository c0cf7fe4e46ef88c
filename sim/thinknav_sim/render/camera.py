"""A pinhole camera on an agent, like that of Habitat's HM3D ObjectNav. Knows nothing of renderers."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Camera:
    """A camera that looks straight ahead.

    width, height: pixels. hfov: horizontal field of view in degrees; pixels are square.
    elevation: metres above the agent's feet.
    """

    width: int = 256
    height: int = 256
    hfov: float = 79.0
    elevation: float = 0.88

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a camera has at least one pixel each way, not {self.width}x{self.height}")
        if not 1.0 <= self.hfov <= 170.0:
            raise ValueError(f"hfov must lie between 1 and 170 degrees, not {self.hfov}")

    @property
    def focal_length(self) -> float:
        """Distance of the image plane in pixels."""
        return self.width / 2 / math.tan(math.radians(self.hfov) / 2)
