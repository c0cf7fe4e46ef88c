"""Textures: PNG, JPEG and WebP through Pillow, KTX2 (Basis Universal, as HM3D ships) through alktx2.

Knows nothing of meshes.
"""

import io
import warnings

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from thinknav_sim.scene import SceneError

_KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"
# 16384 x 16384: the largest texture that graphics cards take.
_MAX_PIXELS = 1 << 28


def decode_image(data: bytes, source: object) -> NDArray[np.uint8]:
    """An image file's bytes as (H, W, 3) uint8 sRGB. Raises SceneError that names the source."""
    if data.startswith(_KTX2):
        data = _ktx2_to_png(data, source)
    try:
        with warnings.catch_warnings():
            # Our own limit below takes the place of Pillow's warning of large images.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data)) as image:
                if image.width * image.height > _MAX_PIXELS:
                    raise SceneError(f"{source} is {image.width} x {image.height}, more than {_MAX_PIXELS} pixels")
                return np.asarray(image.convert("RGB"))
    except SceneError:
        raise
    except Exception as error:  # Pillow's decoders raise many kinds
        raise SceneError(f"{source} cannot be decoded: {error}") from None


def _ktx2_to_png(data: bytes, source: object) -> bytes:
    try:
        import alktx2
    except ImportError:
        raise SceneError(f"{source} is a KTX2 texture; install 'thinknav[scans]' to read it") from None
    try:
        png, _ = alktx2.decode_ktx2_to_bytes(data, format="png")
    except Exception as error:
        raise SceneError(f"{source} is a KTX2 texture that cannot be decoded: {error}") from None
    return bytes(png)
