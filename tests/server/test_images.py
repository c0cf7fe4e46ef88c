"""Frames to pixels: sizes before decoding, and bad bytes refused by name."""

import io
import struct
import zlib

import numpy as np
import pytest
import simplejpeg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from thinknav_proto import Frame, InvalidRequest
from thinknav_server.images import PixelMemory, decode_frame, frame_of_file, frame_size


def picture(height: int = 24, width: int = 32) -> NDArray[np.uint8]:
    rows, columns = np.mgrid[:height, :width]
    return np.stack([rows * 8, columns * 6, 200 - rows], axis=-1).astype(np.uint8)


def png(image: NDArray[np.uint8]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG")
    return file.getvalue()


def png_header(width: int, height: int) -> bytes:
    chunk = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))


def jpeg(image: NDArray[np.uint8]) -> bytes:
    data: bytes = simplejpeg.encode_jpeg(image, quality=95)
    return data


def test_raw_and_png_keep_every_pixel() -> None:
    image = picture()
    for frame in (Frame.raw(image), frame_of_file(png(image))):
        assert frame_size(frame) == (32, 24)
        np.testing.assert_array_equal(decode_frame(frame), image)


def test_jpeg_keeps_the_picture() -> None:
    frame = frame_of_file(jpeg(picture()))
    assert frame.encoding == "jpeg"
    assert frame_size(frame) == (32, 24)
    difference = decode_frame(frame).astype(int) - picture()
    assert np.abs(difference).mean() < 3


def test_grey_and_transparent_files_become_rgb() -> None:
    grey: NDArray[np.uint8] = picture()[:, :, 0].copy()
    assert decode_frame(frame_of_file(png(grey))).shape == (24, 32, 3)
    assert decode_frame(frame_of_file(png(np.dstack([picture(), grey])))).shape == (24, 32, 3)
    grey_jpeg = simplejpeg.encode_jpeg(grey[:, :, None], colorspace="GRAY", colorsubsampling="Gray")
    assert decode_frame(frame_of_file(grey_jpeg)).shape == (24, 32, 3)


def test_frames_in_one_memory_are_what_each_is_alone() -> None:
    memory = PixelMemory()
    images = [picture(), picture(40, 16), picture()[::-1].copy(), picture(1200, 1600), picture(1500, 1600), picture()]
    frames = [frame_of_file(jpeg(image)) for image in images]
    decoded = [decode_frame(frame, memory) for frame in frames]
    for pixels, frame in zip(decoded, frames, strict=True):
        np.testing.assert_array_equal(pixels, decode_frame(frame))
    with pytest.raises(InvalidRequest, match="cannot be decoded"):
        decode_frame(Frame(encoding="jpeg", data=b"none"), memory)


def test_sizes_are_read_from_a_header_that_promises_what_it_does_not_hold() -> None:
    frame = Frame(encoding="png", data=png_header(60_000, 60_000))
    assert frame_size(frame) == (60_000, 60_000)


@pytest.mark.parametrize("data", [b"GIF89a", b"\xff\xd8", b"<html>"])
def test_other_files_are_no_frames(data: bytes) -> None:
    with pytest.raises(InvalidRequest, match="neither a JPEG nor a PNG"):
        frame_of_file(data)


def test_truncated_files_are_refused() -> None:
    for data in (jpeg(picture()), png(picture())):
        with pytest.raises(InvalidRequest, match="cannot be decoded"):
            decode_frame(frame_of_file(data[:-30]))


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def test_a_png_whose_second_header_lies_is_refused() -> None:
    lie = png_header(16, 16) + png_header(4000, 4000)[8:] + chunk(b"IDAT", zlib.compress(bytes(4000 * 12001)))
    frame = frame_of_file(lie + chunk(b"IEND", b""))
    assert frame_size(frame) == (16, 16)
    with pytest.raises(InvalidRequest, match="its headers contradict each other"):
        decode_frame(frame)


def test_a_jpeg_of_endless_scans_is_refused_from_its_header() -> None:
    file = io.BytesIO()
    Image.fromarray(picture(256, 256)).save(file, "JPEG", progressive=True)
    good = file.getvalue()
    assert frame_size(frame_of_file(good)) == (256, 256)
    scan = good[good.rfind(b"\xff\xda") : -2]
    with pytest.raises(InvalidRequest, match="more than 32 scans"):
        frame_size(frame_of_file(good[:-2] + scan * 30 + good[-2:]))


def test_a_png_without_pixels_is_refused() -> None:
    with pytest.raises(InvalidRequest, match="no pixels"):
        frame_size(Frame(encoding="png", data=png_header(0, 5)))


@settings(deadline=None, max_examples=100)
@given(st.sampled_from(["jpeg", "png"]), st.data())
def test_no_damage_does_more_than_name_an_error(kind: str, data: st.DataObject) -> None:
    good = jpeg(picture()) if kind == "jpeg" else png(picture())
    position = data.draw(st.integers(0, len(good) - 1))
    damaged = good[:position] + data.draw(st.binary(max_size=8)) + good[position + data.draw(st.integers(0, 8)) :]
    frame = Frame(encoding="jpeg" if kind == "jpeg" else "png", data=damaged or b"\x00")
    try:
        width, height = frame_size(frame)
        if width * height < 1_000_000:
            assert decode_frame(frame).shape == (height, width, 3)
    except InvalidRequest as error:
        assert error.message  # noqa: PT017 - either outcome is right
