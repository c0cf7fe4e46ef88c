"""Textures: PNG, JPEG and WebP through Pillow, KTX2 (Basis Universal, as HM3D ships) through alktx2.

Knows nothing of meshes.
"""

import io
import struct
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
    _check_ktx2(data, source)
    try:
        import alktx2
    except ImportError:
        raise SceneError(f"{source} is a KTX2 texture; install 'thinknav[scans]' to read it") from None
    try:
        png, _ = alktx2.decode_ktx2_to_bytes(data, format="png")
    except Exception as error:
        raise SceneError(f"{source} is a KTX2 texture that cannot be decoded: {error}") from None
    return bytes(png)


def _check_ktx2(data: bytes, source: object) -> None:
    """Sizes and level index of a KTX2 file, before a decoder written in C++ trusts them."""
    if len(data) < 104:
        raise SceneError(f"{source} is a KTX2 texture that is truncated")
    width, height, depth, layers, faces, levels = struct.unpack_from("<6I", data, 20)
    if not 0 < width * height <= _MAX_PIXELS or depth > 1 or layers > 1 or faces != 1 or not 0 < levels <= 32:
        raise SceneError(f"{source} is a KTX2 texture of {width} x {height} pixels and {levels} levels, no plain image")
    index = 80 + 24 * levels
    parts = [struct.unpack_from("<2Q", data, 80 + 24 * level) for level in range(levels) if index <= len(data)]
    parts += [struct.unpack_from("<2I", data, 48), struct.unpack_from("<2I", data, 56)]
    parts += [struct.unpack_from("<2Q", data, 64)]
    if index > len(data) or any(offset + size > len(data) for offset, size in parts):
        raise SceneError(f"{source} is a KTX2 texture that is truncated: it names more than its {len(data)} bytes")
