"""Images as the frames of requests."""

from typing import Literal

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from thinknav_proto import Frame

JPEG_QUALITY = 90


def encode_frame(rgb: NDArray[np.uint8], encoding: Literal["jpeg", "raw"] = "jpeg", heading: float = 0.0) -> Frame:
    """The frame of an image (H, W, 3) uint8: JPEG at quality 90, or the pixels as they are.

    heading: radians, counter-clockwise, relative to the request's own frame. Raises ValueError for another shape.
    """
    if encoding == "raw":
        return Frame.raw(rgb, heading)
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or not rgb.size:
        raise ValueError(f"a frame must be (H, W, 3) uint8, not {rgb.shape} {rgb.dtype}")
    data = simplejpeg.encode_jpeg(np.ascontiguousarray(rgb), quality=JPEG_QUALITY, colorspace="RGB")
    return Frame(encoding="jpeg", data=data, heading=heading)
