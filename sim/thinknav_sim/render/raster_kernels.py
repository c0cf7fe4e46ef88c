# mypy: disable-error-code="assignment, arg-type"
"""Compiled loops of the z-buffer rasteriser: which clusters a view needs, nearest first, and their triangles' pixels.

A pixel holds one number: the bits of the inverse of the depth, and below them which triangle it is. The larger number
is the nearer one, so that a row of pixels is drawn by a maximum. Knows nothing of colours.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from thinknav_sim.render import raster_setup as row
from thinknav_sim.render.native_call import array_at
from thinknav_sim.render.raster_clusters import BLOCK, CLUSTER
from thinknav_sim.render.raster_setup import View, Window, prepare_cluster, to_camera
from thinknav_sim.render.raster_shading import DepthScale, Planes, shade, write_plane

# Pixels a side of the squares whose farthest pixel is remembered: what lies behind all of a square's is not drawn.
TILE = 8
# Pixels to be drawn at once. A row's last span reaches past its end, but raises nothing there.
SPAN = 16
# How many clusters are drawn between two looks at which squares are covered.
_CLUSTERS_A_LOOK = 32
# A cluster nearer than this, metres, may reach round the camera: all of the picture.
_TOO_NEAR = 1e-3
# Rounding in a pixel's depth, as a share of it.
_DEPTH_MARGIN = 1e-5

# The arrays of `Clusters`.
RasterScene = tuple[
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.uint8],
    NDArray[np.float32],
    NDArray[np.int32],
    NDArray[np.int64],
    NDArray[np.uint8],
]
_UNDRAWN = np.int64(0x7FFFFFFFFFFFFFFF)
_LOW_BITS = np.int64(0xFFFFFFFF)


@njit(cache=True, nogil=True, error_model="numpy")
def _key(inverse_depth: float, number: int) -> int:
    key: int = (np.int64(np.float32(inverse_depth).view(np.int32)) << 32) | number
    return key


@njit(cache=True, nogil=True, error_model="numpy")
def _box_in_sight(box: NDArray[np.float32], view: View, window: Window) -> tuple[float, float]:
    """How far ahead a box begins and ends, metres; an end below 0 where it is to a side of the picture."""
    left_slope, right_slope = (window[0] - 1 - view[6]) * view[5], (window[1] + 1 - view[6]) * view[5]
    nearest, farthest, within_left, within_right = np.inf, -np.inf, -np.inf, -np.inf
    for corner in range(4):
        x, _, ahead = to_camera(view, box[3 * (corner & 1)], 0.0, box[2 + 3 * (corner >> 1)])
        nearest, farthest = min(nearest, ahead), max(farthest, ahead)
        within_left = max(within_left, x - left_slope * ahead)
        within_right = max(within_right, right_slope * ahead - x)
    return nearest, farthest if within_left >= 0 and within_right >= 0 else -1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _box_on_picture(box: NDArray[np.float32], view: View, window: Window, rectangle: NDArray[np.int64]) -> float:
    """How far ahead a box begins, metres, or -1 where it is not in the picture. rectangle: the pixels it may cover."""
    nearest, farthest = _box_in_sight(box, view, window)
    if farthest <= 0:
        return -1.0
    if nearest < _TOO_NEAR:
        for side in range(4):
            rectangle[side] = int(window[side])
        return 0.0
    low, high = box[1] - view[1], box[4] - view[1]
    top = view[7] - max(high / nearest, high / farthest) / view[5] - 1
    bottom = view[7] - min(low / nearest, low / farthest) / view[5] + 1
    if top > window[3] or bottom < window[2]:
        return -1.0
    left, right = np.inf, -np.inf
    for corner in range(4):
        x, _, ahead = to_camera(view, box[3 * (corner & 1)], 0.0, box[2 + 3 * (corner >> 1)])
        left, right = min(left, x / ahead), max(right, x / ahead)
    left, right = left / view[5] + view[6] - 1, right / view[5] + view[6] + 1
    if left > window[1] or right < window[0]:
        return -1.0
    rectangle[0], rectangle[1] = int(max(left, window[0])), int(min(right, window[1]))
    rectangle[2], rectangle[3] = int(max(top, window[2])), int(min(bottom, window[3]))
    return nearest


@njit(cache=True, nogil=True, error_model="numpy")
def _look_at_tiles(keys: NDArray[np.int64], farthest: NDArray[np.int64]) -> None:
    """Write the least key of each square of pixels. keys: (rows, W + SPAN)."""
    width = keys.shape[1] - SPAN
    least = np.empty((farthest.shape[1], TILE), np.int64)
    flat = least.reshape(-1)
    for tile_row in range(len(farthest)):
        # Where the last square is not whole, columns that are not there count for nothing.
        least[:] = _UNDRAWN
        for y in range(tile_row * TILE, min(len(keys), tile_row * TILE + TILE)):
            line = keys[y, :width]
            for x in range(width):
                flat[x] = min(flat[x], line[x])
        for tile in range(farthest.shape[1]):
            lowest = least[tile, 0]
            for i in range(1, TILE):
                lowest = min(lowest, least[tile, i])
            farthest[tile_row, tile] = lowest


@njit(cache=True, nogil=True, error_model="numpy")
def _is_covered(
    farthest: NDArray[np.int64], left: int, right: int, top: int, bottom: int, inverse_nearest: float
) -> bool:
    """Whether all that was drawn in a rectangle, rows counted from the first of the keys, is nearer."""
    key = _key((1 + _DEPTH_MARGIN) * inverse_nearest, _LOW_BITS)
    for tile_row in range(top // TILE, bottom // TILE + 1):
        for tile in range(left // TILE, right // TILE + 1):
            if farthest[tile_row, tile] < key:
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_triangle(
    prepared: NDArray[np.float64], column: int, number: int, keys: NDArray[np.int64], first_row: int
) -> None:
    """Raise the keys of the pixels in a triangle. keys: (rows, W + SPAN), rows of the picture from first_row on."""
    a, b = row.PLANE, row.PLANE + 1
    step, slope, start = prepared[a, column], prepared[b, column], prepared[b + 1, column]
    least, greatest = np.float32(prepared[row.FARTHEST, column]), np.float32(prepared[row.NEAREST, column])
    rise = np.float32(step)
    left, right = prepared[row.LEFT, column], prepared[row.RIGHT, column]
    b0, c0, crossing0 = prepared[1, column], prepared[2, column], prepared[row.CROSSING, column]
    b1, c1, crossing1 = prepared[4, column], prepared[5, column], prepared[row.CROSSING + 1, column]
    b2, c2, crossing2 = prepared[7, column], prepared[8, column], prepared[row.CROSSING + 2, column]
    for y in range(int(prepared[row.TOP, column]), int(prepared[row.BOTTOM, column]) + 1):
        x0, x1, x2 = (b0 * y + c0) * crossing0, (b1 * y + c1) * crossing1, (b2 * y + c2) * crossing2
        begin = max(
            max(left, x0 if crossing0 < 0 else left),
            max(x1 if crossing1 < 0 else left, x2 if crossing2 < 0 else left),
        )
        end = min(
            min(right, right if crossing0 < 0 else x0),
            min(right if crossing1 < 0 else x1, right if crossing2 < 0 else x2),
        )
        # Too far apart for integers, too.
        if not begin <= end:
            continue
        first, last = int(np.ceil(begin)), int(np.floor(end))
        inverse = np.float32(step * first + slope * y + start)
        for left_end in range(first, last + 1, SPAN):
            span = keys[y - first_row, left_end : left_end + SPAN]
            at_left = inverse + rise * np.float32(left_end - first)
            for i in range(SPAN):
                here = min(max(at_left + rise * np.float32(i), least), greatest)
                span[i] = max(span[i], _key(here, number) if left_end + i <= last else 0)


@njit(cache=True, nogil=True, error_model="numpy")
def visible_clusters(
    blocks: NDArray[np.float32],
    boxes: NDArray[np.float32],
    view: View,
    window: Window,
    rectangles: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The clusters whose boxes are in the picture, nearest first, and how far ahead they begin.

    rectangles: (K, 4), the pixels that each may cover is written: first and last column, first and last row.
    """
    chosen, ahead = np.empty(len(boxes), np.int64), np.empty(len(boxes), np.float64)
    count = 0
    for block in range(len(blocks)):
        if _box_in_sight(blocks[block], view, window)[1] <= 0:
            continue
        for cluster in range(BLOCK * block, min(BLOCK * block + BLOCK, len(boxes))):
            nearest = _box_on_picture(boxes[cluster], view, window, rectangles[cluster])
            if nearest >= 0:
                chosen[count], ahead[count] = cluster, nearest
                count += 1
    order = np.argsort(ahead[:count], kind="mergesort")
    return chosen[:count][order], ahead[:count][order]


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_rows(
    clusters: RasterScene,
    view: View,
    window: Window,
    keys: NDArray[np.int64],
    planes: Planes,
) -> None:
    """Draw the triangles of a view's rows into keys, (rows, W + SPAN), and write the planes of those that may show.

    Number 0 is nothing's: its plane is black.
    """
    blocks, boxes, corners, colors, corner_uv, triangle_textures, sizes, _ = clusters
    keys[:] = 0
    planes[0][0] = 0
    planes[1][0] = -1
    first_row = int(window[2])
    farthest = np.zeros(((keys.shape[0] + TILE - 1) // TILE, (keys.shape[1] - SPAN + TILE - 1) // TILE), np.int64)
    rectangles = np.empty((len(boxes), 4), np.int64)
    prepared = np.empty((row.ROWS, CLUSTER), np.float64)
    visible, ahead = visible_clusters(blocks, boxes, view, window, rectangles)
    number = 1
    drawn = 0
    for index in range(len(visible)):
        cluster = visible[index]
        left, right, top, bottom = rectangles[cluster]
        if ahead[index] > 0 and _is_covered(
            farthest, left, right, top - first_row, bottom - first_row, 1 / ahead[index]
        ):
            continue
        prepare_cluster(corners[cluster].ctypes.data, view, window, prepared.ctypes.data)
        for column in range(CLUSTER):
            if prepared[row.TOP, column] > prepared[row.BOTTOM, column]:
                continue
            if drawn >= _CLUSTERS_A_LOOK and _is_covered(
                farthest,
                int(prepared[row.LEFT, column]),
                int(prepared[row.RIGHT, column]),
                int(prepared[row.TOP, column]) - first_row,
                int(prepared[row.BOTTOM, column]) - first_row,
                prepared[row.NEAREST, column],
            ):
                continue
            _draw_triangle(prepared, column, number, keys, first_row)
            triangle = cluster * CLUSTER + column
            texture = triangle_textures[triangle] if len(sizes) else -1
            planes[1][number] = texture
            if texture >= 0:
                write_plane(prepared, column, corner_uv[triangle], planes[0][number])
            else:
                write_plane(prepared, column, colors[triangle], planes[0][number])
            number += 1
        drawn += 1
        if drawn % _CLUSTERS_A_LOOK == 0:
            _look_at_tiles(keys, farthest)


@njit(cache=True, nogil=True, error_model="numpy")
def _scene_at(addresses: NDArray[np.int64]) -> RasterScene:
    """The arrays of a scene, from its row of `draw_views`."""
    return (
        array_at(addresses[0], (addresses[1], 6), np.float32),
        array_at(addresses[2], (addresses[3], 6), np.float32),
        array_at(addresses[4], (addresses[5], 9, CLUSTER), np.float32),
        array_at(addresses[6], (addresses[7], 9), np.uint8),
        array_at(addresses[8], (addresses[9], 6), np.float32),
        array_at(addresses[10], (addresses[11],), np.int32),
        array_at(addresses[12], (addresses[13], 3), np.int64),
        array_at(addresses[14], (addresses[15],), np.uint8),
    )


@njit(cache=True, parallel=True, nogil=True, error_model="numpy")
def draw_views(
    scenes: NDArray[np.int64],
    poses: NDArray[np.float64],
    camera: tuple[float, float],
    depth_scale: DepthScale,
    bands: int,
    keys: NDArray[np.int64],
    planes: Planes,
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
) -> None:
    """Draw N views, each in so many bands of rows, dealt in turn to as many threads as there are keys.

    scenes: (N, 16) int64, addresses and lengths of a view's Clusters. poses: (N, 4) float64.
    camera: the width of a pixel on a plane at 1 m, and the elevation, metres.
    keys: (threads, band's rows, W + SPAN).
    planes: (threads, triangles + 1, 9) and (threads, triangles + 1): see `Planes`
    rgb (N, H, W, 3) uint8 and depth (N, H, W) float32 are written.
    """
    views, height, width = depth.shape
    threads, band_rows = keys.shape[0], keys.shape[1]
    for thread in prange(threads):
        own_planes = (planes[0][thread], planes[1][thread])
        for item in range(thread, views * bands, threads):
            index, top = item // bands, item % bands * band_rows
            bottom = min(top + band_rows, height)
            if top >= bottom:
                continue
            pose = poses[index]
            view = (
                pose[0],
                pose[1] + camera[1],
                pose[2],
                np.sin(pose[3]),
                np.cos(pose[3]),
                camera[0],
                width / 2 - 0.5,
                height / 2 - 0.5,
            )
            window = (0.0, width - 1.0, float(top), bottom - 1.0)
            scene = _scene_at(scenes[index])
            own_keys = keys[thread, : bottom - top]
            _draw_rows(scene, view, window, own_keys, own_planes)
            shade(
                own_keys,
                top,
                own_planes,
                (scene[6], scene[7]),
                depth_scale,
                rgb[index, top:bottom],
                depth[index, top:bottom],
            )
