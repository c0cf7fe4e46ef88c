"""Habitat's rotations, quaternions [x, y, z, w], and our headings. Knows nothing of episodes."""

import math
from collections.abc import Sequence

# How far from 1 the length of a quaternion may be: files hold five decimals.
_NORM_TOLERANCE = 1e-3
# An agent that looks this steeply up or down has no heading to speak of.
_LEAST_HORIZONTAL = 1e-3


def rotation_of(heading: float) -> tuple[float, float, float, float]:
    """The quaternion [x, y, z, w] of an upright agent with this heading (radians, counter-clockwise from -z)."""
    return 0.0, math.sin(heading / 2), 0.0, math.cos(heading / 2)


def heading_of(rotation: Sequence[float]) -> float:
    """The heading, in [-pi, pi], of an agent with this quaternion [x, y, z, w]: that of where it looks, on the floor.

    Raises ValueError for a quaternion that is not of length 1, or that looks straight up or down.
    """
    x, y, z, w = rotation
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) <= _NORM_TOLERANCE:
        raise ValueError(f"rotation {list(rotation)} has length {norm:.4g}, not 1")
    # Forward is the rotated -z axis: (-sin h, _, -cos h).
    sine, cosine = 2.0 * (x * z + w * y) / norm**2, 1.0 - 2.0 * (x * x + y * y) / norm**2
    if math.hypot(sine, cosine) < _LEAST_HORIZONTAL:
        raise ValueError(f"rotation {list(rotation)} looks straight up or down")
    return math.atan2(sine, cosine)
