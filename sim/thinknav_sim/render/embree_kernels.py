"""Compiled loops that fill Embree's ray packets, intersect them, and read colours and depths off the hits.

A packet is Embree's `RTCRayHitK`: for K rays, rows of K four-byte values, one row for each field below. The
kernels take K from the scratch array's shape and Embree's function by address, so that one compilation, kept
in numba's cache, serves every width and every process. They know nothing of how scenes are built, and check
nothing.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from thinknav_sim.render.native_call import array_at, intersect_packet
from thinknav_sim.render.renderer import NOTHING_DEPTH

# Rows of RTCRayHitK in use.
_ORIGIN, _NEAR, _DIRECTION, _TIME, _FAR, _MASK, _ID, _FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
_U, _V, _TRIANGLE, _GEOMETRY = 15, 16, 17, 18
# Which rays to intersect: -1 yes, 0 no. A row of its own behind the packet's 21.
_VALID = 24
# Where a ray's pixel lies in its tile: our own row, too.
_COLUMN = 25
_ROWS = 32
_NO_GEOMETRY = -1
_ALL_MASKS = -1
_CACHE_LINE_BYTES = 64
# Pictures are drawn in square blocks of so many pixels a side: what the rays of a block meet stays in the cache, and
# threads have small pieces to share. A multiple of every tile's sides.
_BLOCK = 32

# The constant and the slopes in u and v of one quantity (a colour channel, a texture coordinate) over a triangle.
Channel = tuple[np.float32, np.float32, np.float32]
# What the triangles of a scene look like: corner colours (T, 3, 3) uint8; corner texture coordinates (T, 3, 2) float32
# and textures (T,) int32, both empty where nothing is textured; see `textures.pack_textures` for the rest.
Surface = tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32], NDArray[np.int64], NDArray[np.uint8]]
# Low, high, span: see `Camera.depth_scale`.
DepthScale = tuple[np.float32, np.float32, np.float32]


def surface_row(surface: Surface) -> list[int]:
    """Addresses and lengths of a surface's arrays, in the order in which `draw_views` takes them."""
    return [number for array in surface for number in (array.ctypes.data, len(array))]


def packet_scratch(threads: int, packet_width: int) -> NDArray[np.int32]:
    """A packet for each thread: (threads, rows, K) int32, aligned as Embree and the cache ask."""
    size = threads * _ROWS * packet_width
    memory = np.zeros(size + _CACHE_LINE_BYTES // 4, np.int32)
    start = -memory.ctypes.data % _CACHE_LINE_BYTES // 4
    return memory[start : start + size].reshape(threads, _ROWS, packet_width)


@njit(cache=True, nogil=True, error_model="numpy")
def _color_plane(corners: NDArray[np.uint8]) -> tuple[Channel, Channel, Channel]:
    """A triangle's colour as a linear function of u and v, from its corners' (3, 3).

    Half a level is added, so that cutting off the fraction rounds.
    """
    red, green, blue = np.float32(corners[0, 0]), np.float32(corners[0, 1]), np.float32(corners[0, 2])
    half = np.float32(0.5)
    return (
        (red + half, np.float32(corners[1, 0]) - red, np.float32(corners[2, 0]) - red),
        (green + half, np.float32(corners[1, 1]) - green, np.float32(corners[2, 1]) - green),
        (blue + half, np.float32(corners[1, 2]) - blue, np.float32(corners[2, 2]) - blue),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _color_level(channel: Channel, u: np.float32, v: np.float32) -> np.uint8:
    return np.uint8(np.int32(channel[0] + u * channel[1] + v * channel[2]))


@njit(cache=True, nogil=True, error_model="numpy")
def _texture_plane(corners: NDArray[np.float32]) -> tuple[Channel, Channel]:
    """A triangle's texture coordinates as linear functions of the hit's u and v, from its corners' (3, 2)."""
    across, down = corners[0, 0], corners[0, 1]
    return (
        (across, corners[1, 0] - across, corners[2, 0] - across),
        (down, corners[1, 1] - down, corners[2, 1] - down),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _texel_index(channel: Channel, u: np.float32, v: np.float32, size: int) -> int:
    """The texel along one side of a repeating texture."""
    place = channel[0] + u * channel[1] + v * channel[2]
    # A fraction just below 1 may round up to it.
    texel: int = min(int((place - np.floor(place)) * np.float32(size)), size - 1)
    return texel


@njit(cache=True, nogil=True, error_model="numpy")
def _texel_address(size: NDArray[np.int64], across: Channel, down: Channel, u: np.float32, v: np.float32) -> int:
    """Where a texel's three bytes begin. size: a texture's first texel, height and width."""
    first, height, width = size
    address: int = 3 * (first + _texel_index(down, u, v, height) * width + _texel_index(across, u, v, width))
    return address


@njit(cache=True, nogil=True, error_model="numpy")
def _on_scale(metres: np.float32, depth_scale: DepthScale) -> np.float32:
    low, high, span = depth_scale
    reading: np.float32 = (min(max(metres, low), high) - low) / span
    return reading


@njit(cache=True, nogil=True, error_model="numpy")
def _surface_at(row: NDArray[np.int64]) -> Surface:
    """The arrays of a scene, from its row of `draw_views`."""
    return (
        array_at(row[1], (row[2], 3, 3), np.uint8),
        array_at(row[3], (row[4], 3, 2), np.float32),
        array_at(row[5], (row[6],), np.int32),
        array_at(row[7], (row[8], 3), np.int64),
        array_at(row[9], (row[10],), np.uint8),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _tile_shape(lanes: int) -> tuple[int, int]:
    """Height and width of the block of pixels that a packet covers: 4x4, 2x4 or 2x2."""
    height = 4 if lanes == 16 else 2
    return height, lanes // height


@njit(cache=True, nogil=True, error_model="numpy")
def _start_block(packet: NDArray[np.int32], pose: NDArray[np.float64], elevation: float) -> None:
    """Write what all rays of a view have in common."""
    rays = packet.view(np.float32)
    for lane in range(packet.shape[1]):
        rays[_ORIGIN, lane] = pose[0]
        rays[_ORIGIN + 1, lane] = pose[1] + elevation
        rays[_ORIGIN + 2, lane] = pose[2]
        rays[_NEAR, lane] = 0
        rays[_TIME, lane] = 0
        packet[_MASK, lane] = _ALL_MASKS
        packet[_ID, lane] = 0
        packet[_FLAGS, lane] = 0
        packet[_VALID, lane] = -1
        rays[_COLUMN, lane] = lane % _tile_shape(packet.shape[1])[1]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _shade(
    packet: NDArray[np.int32],
    surface: Surface,
    corner: tuple[int, int],
    depth_scale: DepthScale,
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
) -> None:
    """Write the pixels of a tile whose rays are cast. corner: its first row and column."""
    colors, corner_uv, triangle_textures, texture_sizes, texels = surface
    rays = packet.view(np.float32)
    tile_height, tile_width = _tile_shape(packet.shape[1])
    top, left = corner
    shaded = texture = -1
    red = green = blue = across = down = (np.float32(0), np.float32(0), np.float32(0))
    for row in range(min(tile_height, depth.shape[0] - top)):
        for column in range(min(tile_width, depth.shape[1] - left)):
            lane = row * tile_width + column
            y, x = top + row, left + column
            if packet[_GEOMETRY, lane] == _NO_GEOMETRY:
                depth[y, x, 0] = _on_scale(np.float32(NOTHING_DEPTH), depth_scale)
                rgb[y, x, 0] = rgb[y, x, 1] = rgb[y, x, 2] = 0
                continue
            depth[y, x, 0] = _on_scale(rays[_FAR, lane], depth_scale)
            # Neighbours mostly see the same triangle: its colours stay in registers.
            if packet[_TRIANGLE, lane] != shaded:
                shaded = packet[_TRIANGLE, lane]
                texture = triangle_textures[shaded] if len(triangle_textures) else -1
                if texture >= 0:
                    across, down = _texture_plane(corner_uv[shaded])
                else:
                    red, green, blue = _color_plane(colors[shaded])
            u, v = rays[_U, lane], rays[_V, lane]
            if texture >= 0:
                texel = _texel_address(texture_sizes[texture], across, down, u, v)
                rgb[y, x, 0], rgb[y, x, 1], rgb[y, x, 2] = texels[texel], texels[texel + 1], texels[texel + 2]
            else:
                rgb[y, x, 0] = _color_level(red, u, v)
                rgb[y, x, 1] = _color_level(green, u, v)
                rgb[y, x, 2] = _color_level(blue, u, v)


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_block(
    intersect: int,
    arguments: int,
    scene: int,
    surface: Surface,
    pose: NDArray[np.float64],
    camera: tuple[float, float],
    depth_scale: DepthScale,
    packet: NDArray[np.int32],
    corner: tuple[int, int],
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
) -> None:
    """Draw the tiles of one block of a view. corner: the block's first row and column."""
    height, width = depth.shape[0], depth.shape[1]
    lanes = packet.shape[1]
    tile_height, tile_width = _tile_shape(lanes)
    _start_block(packet, pose, camera[1])
    pixel = np.float32(camera[0])
    sine, cosine = np.float32(np.sin(pose[3])), np.float32(np.cos(pose[3]))
    middle = np.float32(width / 2 - 0.5)
    rays = packet.view(np.float32)
    address = packet.ctypes.data
    valid = address + _VALID * lanes * 4
    for top in range(corner[0], min(corner[0] + _BLOCK, height), tile_height):
        for lane in range(lanes):
            rays[_DIRECTION + 1, lane] = (height / 2 - (top + lane // tile_width) - 0.5) * camera[0]
        for left in range(corner[1], min(corner[1] + _BLOCK, width), tile_width):
            start = np.float32(left) - middle
            for lane in range(lanes):
                # Forward has length 1 and the ray is not normalised: the hit's distance is the depth.
                right = (start + rays[_COLUMN, lane]) * pixel
                rays[_DIRECTION, lane] = right * cosine - sine
                rays[_DIRECTION + 2, lane] = -right * sine - cosine
                rays[_FAR, lane] = np.inf
                packet[_GEOMETRY, lane] = _NO_GEOMETRY
            intersect_packet(intersect, valid, scene, address, arguments)
            _shade(packet, surface, (top, left), depth_scale, rgb, depth)


@njit(cache=True, parallel=True, nogil=True, error_model="numpy")
def draw_views(
    intersect: int,
    arguments: int,
    scenes: NDArray[np.int64],
    poses: NDArray[np.float64],
    camera: tuple[float, float],
    depth_scale: DepthScale,
    packets: NDArray[np.int32],
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
) -> None:
    """Draw N views, blocks of tiles dealt in turn to as many threads as there are packets.

    intersect, arguments: addresses of rtcIntersectK and of its RTCIntersectArguments.
    scenes: (N, 11) int64, a view's Embree scene, then addresses and lengths of its Surface: see `surface_row`.
    poses: (N, 4) float64. packets: from `packet_scratch`.
    camera: the width of a pixel on a plane at 1 m, and the elevation, metres.
    rgb (N, H, W, 3) uint8 and depth (N, H, W, 1) float32 are written.
    """
    views, height, width = depth.shape[0], depth.shape[1], depth.shape[2]
    threads = packets.shape[0]
    rows, columns = (height + _BLOCK - 1) // _BLOCK, (width + _BLOCK - 1) // _BLOCK
    for thread in prange(threads):
        for block in range(thread, views * rows * columns, threads):
            view = block // (rows * columns)
            corner = (block // columns % rows * _BLOCK, block % columns * _BLOCK)
            _draw_block(
                intersect,
                arguments,
                scenes[view, 0],
                _surface_at(scenes[view]),
                poses[view],
                camera,
                depth_scale,
                packets[thread],
                corner,
                rgb[view],
                depth[view],
            )


@njit(cache=True, parallel=True, nogil=True, error_model="numpy")
def cast_rays(
    intersect: int,
    arguments: int,
    scene: int,
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    packets: NDArray[np.int32],
    distance: NDArray[np.float32],
    triangle: NDArray[np.int32],
) -> None:
    """First hits of R rays, packets of K dealt in turn to as many threads as there are packets.

    origins, directions: (R, 3) float32. distance (R,) float32 and triangle (R,) int32 are written.
    """
    rays = len(origins)
    threads, lanes = packets.shape[0], packets.shape[2]
    for thread in prange(threads):
        packet = packets[thread]
        fields = packet.view(np.float32)
        address = packet.ctypes.data
        for first in range(thread * lanes, rays, threads * lanes):
            for lane in range(lanes):
                ray = first + lane
                packet[_VALID, lane] = -1 if ray < rays else 0
                packet[_GEOMETRY, lane] = _NO_GEOMETRY
                if ray >= rays:
                    continue
                for axis in range(3):
                    fields[_ORIGIN + axis, lane] = origins[ray, axis]
                    fields[_DIRECTION + axis, lane] = directions[ray, axis]
                fields[_NEAR, lane] = 0
                fields[_TIME, lane] = 0
                fields[_FAR, lane] = np.inf
                packet[_MASK, lane] = _ALL_MASKS
                packet[_ID, lane] = 0
                packet[_FLAGS, lane] = 0
            intersect_packet(intersect, address + _VALID * lanes * 4, scene, address, arguments)
            for lane in range(min(lanes, rays - first)):
                hit = packet[_GEOMETRY, lane] != _NO_GEOMETRY
                distance[first + lane] = fields[_FAR, lane] if hit else np.inf
                triangle[first + lane] = packet[_TRIANGLE, lane] if hit else -1
