"""Compiled loops that turn the pixels' keys into colours and depths. Knows nothing of how keys come about."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thinknav_sim.render import raster_setup as row

# Pixels coloured at once where they show one triangle: as many as an AVX2 instruction takes.
_RUN = 8

# Colour planes of the drawn triangles, (N, 9) float32: red, green, blue times the inverse of the depth as
# a x + b y + c; three a, three b, three c. With a texture, in place of red and green, its place.
# And which texture, (N,) int32, -1 for none.
Planes = tuple[NDArray[np.float32], NDArray[np.int32]]
# Low, high, span: see `Camera.depth_scale`.
DepthScale = tuple[np.float32, np.float32, np.float32]
# A scene's `Clusters.sizes` and `texels`.
Textures = tuple[NDArray[np.int64], NDArray[np.uint8]]


@njit(cache=True, nogil=True, error_model="numpy")
def write_plane(
    prepared: NDArray[np.float64],
    column: int,
    values: NDArray[np.uint8] | NDArray[np.float32],
    plane: NDArray[np.float32],
) -> None:
    """Write how a triangle's values run over the picture, from its corners' (3 * channels,)."""
    channels = len(values) // 3
    scale = prepared[row.SCALE, column]
    for channel in range(channels):
        first, second = values[channel] * scale, values[channels + channel] * scale
        third = values[2 * channels + channel] * scale
        for term in range(3):
            plane[3 * term + channel] = (
                first * prepared[row.LINE + term, column]
                + second * prepared[row.LINE + 3 + term, column]
                + third * prepared[row.LINE + 6 + term, column]
            )
    # A place on a texture has two; what memory held for the third may be denormal, and then every pixel is slow.
    for unused in range(channels, 3):
        plane[unused] = plane[3 + unused] = plane[6 + unused] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def _level(value: np.float32) -> np.uint8:
    """A colour level, rounded."""
    half = np.float32(0.5)
    return np.uint8(np.int32(min(max(value + half, half), np.float32(255))))


@njit(cache=True, nogil=True, error_model="numpy")
def _texel(place: np.float32, size: int) -> int:
    """The texel along one side of a repeating texture."""
    # A fraction just below 1 may round up to it.
    texel: int = min(int((place - np.floor(place)) * np.float32(size)), size - 1)
    return texel


@njit(cache=True, nogil=True, error_model="numpy")
def _interpolate(
    numbers: NDArray[np.uint32],
    depths: NDArray[np.float32],
    y: np.float32,
    planes: NDArray[np.float32],
    values: NDArray[np.float32],
) -> None:
    """Write the three values at the pixels of a row. numbers, depths: (runs, _RUN). values: (3, runs, _RUN)."""
    for run in range(len(numbers)):
        number = numbers[run, 0]
        mixed = np.uint32(0)
        for i in range(_RUN):
            mixed |= numbers[run, i] ^ number
        start = np.float32(_RUN * run)
        if mixed == 0:
            plane = planes[number]
            for channel in range(3):
                step = plane[channel]
                first = plane[6 + channel] + plane[3 + channel] * y + step * start
                out = values[channel]
                for i in range(_RUN):
                    out[run, i] = (first + step * np.float32(i)) * depths[run, i]
        else:
            for i in range(_RUN):
                plane = planes[numbers[run, i]]
                x, depth = start + np.float32(i), depths[run, i]
                values[0, run, i] = (plane[0] * x + plane[3] * y + plane[6]) * depth
                values[1, run, i] = (plane[1] * x + plane[4] * y + plane[7]) * depth
                values[2, run, i] = (plane[2] * x + plane[5] * y + plane[8]) * depth


@njit(cache=True, nogil=True, error_model="numpy")
def _paper(
    numbers: NDArray[np.uint32],
    places: NDArray[np.float32],
    triangle_textures: NDArray[np.int32],
    textures: Textures,
    rgb: NDArray[np.uint8],
) -> None:
    """Give the pixels of a row that show textured triangles their texels."""
    sizes, texels = textures
    for x in range(len(rgb)):
        texture = triangle_textures[numbers[x]]
        if texture >= 0:
            first, height, width = sizes[texture]
            texel = 3 * (first + _texel(places[1, x], height) * width + _texel(places[0, x], width))
            rgb[x, 0], rgb[x, 1], rgb[x, 2] = texels[texel], texels[texel + 1], texels[texel + 2]


@njit(cache=True, nogil=True, error_model="numpy")
def shade(
    keys: NDArray[np.int64],
    first_row: int,
    planes: Planes,
    textures: Textures,
    depth_scale: DepthScale,
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
) -> None:
    """Write rgb (rows, W, 3) and depth (rows, W) of the picture from first_row on. keys: (rows, W or more)."""
    height, width = depth.shape
    low, high, span = depth_scale
    runs = (width + _RUN - 1) // _RUN
    numbers, depths = np.zeros((runs, _RUN), np.uint32), np.zeros((runs, _RUN), np.float32)
    values = np.empty((3, runs, _RUN), np.float32)
    flat_numbers, flat_depths, flat_values = numbers.reshape(-1), depths.reshape(-1), values.reshape(3, -1)
    red, green, blue = flat_values[0], flat_values[1], flat_values[2]
    for y in range(height):
        line, depth_line, rgb_line = keys[y], depth[y], rgb[y].reshape(-1)
        for x in range(width):
            flat_numbers[x] = np.uint32(line[x])
        for x in range(width):
            inverse = np.float32(np.int32(line[x] >> 32).view(np.float32))
            here = np.float32(1) / inverse if inverse > 0 else np.float32(0)
            flat_depths[x] = here
            depth_line[x] = (min(max(here, low), high) - low) / span
        _interpolate(numbers, depths, np.float32(first_row + y), planes[0], values)
        for x in range(width):
            rgb_line[3 * x] = _level(red[x])
            rgb_line[3 * x + 1] = _level(green[x])
            rgb_line[3 * x + 2] = _level(blue[x])
        if len(textures[0]):
            _paper(flat_numbers, flat_values, planes[1], textures, rgb[y])
