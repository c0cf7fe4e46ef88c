"""Frames to pixels. Sizes are read from headers first, so that limits apply before anything is decoded.

Knows the encodings of the contract and nothing of requests, limits or planners.
"""

import io
import re
import struct
from itertools import islice

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from PIL import Image

from thinknav_proto import Frame, InvalidRequest

_JPEG_START = b"\xff\xd8\xff"
_PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG_SCAN = re.compile(rb"\xff\xda")  # thrice as fast as bytes.count

# Progressive files have about ten. Each scan goes over the whole picture and may be a dozen bytes, so that a short file
# with thousands of them keeps a processor busy for minutes.
MAX_JPEG_SCANS = 32

_BLOCK_BYTES = 8 * 1024 * 1024


def frame_of_file(data: bytes) -> Frame:
    """The frame in an image file. Raises InvalidRequest unless it begins as a JPEG or PNG file does."""
    if data.startswith(_JPEG_START):
        return Frame(encoding="jpeg", data=data)
    if data.startswith(_PNG_START):
        return Frame(encoding="png", data=data)
    raise InvalidRequest(f"the file of {len(data)} bytes is neither a JPEG nor a PNG image")


def frame_size(frame: Frame) -> tuple[int, int]:
    """Width and height in pixels, from the header alone. Raises InvalidRequest for a header that cannot be read, or
    that announces more work than its picture is worth.
    """
    if frame.width is not None and frame.height is not None:
        return frame.width, frame.height
    if frame.encoding == "png":
        return _png_size(frame.data)
    try:
        height, width, _, _ = simplejpeg.decode_jpeg_header(frame.data)
    except ValueError as error:
        raise InvalidRequest(f"the frame is not a JPEG image: {error}") from None
    if next(islice(_JPEG_SCAN.finditer(frame.data), MAX_JPEG_SCANS, None), None):
        raise InvalidRequest(f"the JPEG frame has more than {MAX_JPEG_SCANS} scans; save it as a baseline JPEG")
    return width, height


class PixelMemory:
    """Gives out memory from large blocks, for a system takes longer to find many small ones than one that is large: a
    quarter of what it takes to decode a frame. A block is free when all that lies in it is. For one thread.
    """

    def __init__(self) -> None:
        self._rest = np.empty(0, np.uint8)

    def take(self, height: int, width: int) -> NDArray[np.uint8]:
        """(height, width, 3), not initialised."""
        length = 3 * height * width
        if length > len(self._rest):
            self._rest = np.empty(max(length, _BLOCK_BYTES), np.uint8)
        place, self._rest = self._rest[:length], self._rest[length:]
        return place.reshape(height, width, 3)


def decode_frame(frame: Frame, memory: PixelMemory | None = None) -> NDArray[np.uint8]:
    """The pixels (H, W, 3) uint8; check the size first. Raises InvalidRequest for data it cannot decode.

    memory: where those of a JPEG are to lie.
    """
    if frame.encoding == "raw":
        width, height = frame_size(frame)
        return np.frombuffer(frame.data, dtype=np.uint8).reshape(height, width, 3)
    if frame.encoding == "png":
        return _decode_png(frame)
    try:
        place = memory.take(*simplejpeg.decode_jpeg_header(frame.data)[:2]) if memory else None
        pixels: NDArray[np.uint8] = simplejpeg.decode_jpeg(frame.data, colorspace="RGB", buffer=place)
    except ValueError as error:
        raise InvalidRequest(f"the JPEG frame cannot be decoded: {error}") from None
    return pixels


def _png_size(data: bytes) -> tuple[int, int]:
    # A PNG file is its signature, then the IHDR chunk: length, name, width, height.
    if len(data) < 24 or not data.startswith(_PNG_START) or data[12:16] != b"IHDR":
        raise InvalidRequest("the frame is not a PNG image")
    width, height = struct.unpack(">II", data[16:24])
    if width == 0 or height == 0:
        raise InvalidRequest("the PNG frame has no pixels")
    return width, height


def _decode_png(frame: Frame) -> NDArray[np.uint8]:
    try:
        with Image.open(io.BytesIO(frame.data), formats=["PNG"]) as image:
            # A file may have a second header, which Pillow takes; only the first was held against the limits.
            if image.size != frame_size(frame):
                raise ValueError("its headers contradict each other")
            return np.asarray(image.convert("RGB"))
    except Exception as error:  # Pillow lets OSError, ValueError, SyntaxError, struct.error and others through
        raise InvalidRequest(f"the PNG frame cannot be decoded: {str(error)[:200]}") from None
