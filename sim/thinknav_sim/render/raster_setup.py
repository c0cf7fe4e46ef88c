"""Compiled arithmetic on triangles before they are drawn: from corners in a home to lines and planes on the picture.

A ray through a pixel meets a triangle where the volumes that it spans with each of the triangle's edges have one sign.
Each volume is a linear function of the pixel's place, and so is the inverse of the depth: no triangle is clipped,
whether or not it reaches behind the camera, and two triangles that share an edge share its line to the last bit. So
there are no cracks (Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997). Knows nothing
of what has been drawn already.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thinknav_sim.render.native_call import array_at
from thinknav_sim.render.raster_clusters import CLUSTER

# Rows of the arrays that `prepare_cluster` writes, one column a triangle. The line of an edge: a x + b y + c >= 0 on
# the inner side at column x and row y of the picture, and -1 / a, which is below 0 for an edge on the left.
LINE, CROSSING = 0, 9
# The inverse of the depth: a x + b y + c, and the least and greatest that a corner has.
PLANE, FARTHEST, NEAREST = 12, 15, 16
# What an edge's function is multiplied with to weigh the opposite corner, by the inverse of the depth.
SCALE = 17
# The pixels to look at, both ends included; an empty range of rows for a triangle that is not in the picture.
LEFT, RIGHT, TOP, BOTTOM = 18, 19, 20, 21
ROWS = 22

# Where a triangle passes this near before the camera, metres, its picture ends.
_NEAR = 1e-6
# Added round a triangle's box on the picture, pixels, for rounding: the lines alone say what is inside.
_MARGIN = 1e-4
# Lines flatter than this are horizontal, and crossed at no column or at all of them.
_FLAT = 1e-30
_FAR_OFF = 1e30

Vector = tuple[float, float, float]
# Least and greatest x, least and greatest y.
Bounds = tuple[float, float, float, float]
# The camera's x, y, z; sine and cosine of its heading; the width of a pixel at 1 m; the column and row of the picture's
# middle.
View = tuple[float, float, float, float, float, float, float, float]
# First and last column, first and last row.
Window = tuple[float, float, float, float]


@njit(cache=True, nogil=True, error_model="numpy")
def to_camera(view: View, x: float, y: float, z: float) -> Vector:
    """A place as the camera sees it: to the right, up, forward."""
    across, along = x - view[0], z - view[2]
    return across * view[4] - along * view[3], y - view[1], -across * view[3] - along * view[4]


@njit(cache=True, nogil=True, error_model="numpy")
def _cross(p: Vector, q: Vector) -> Vector:
    """Exactly the opposite when p and q change places."""
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


@njit(cache=True, nogil=True, error_model="numpy")
def _on_picture(view: View, normal: Vector, factor: float) -> Vector:
    """factor * (normal . ray) as a x + b y + c of the ray's column and row."""
    a, b = normal[0] * factor * view[5], -normal[1] * factor * view[5]
    return a, b, normal[2] * factor - a * view[6] - b * view[7]


@njit(cache=True, nogil=True, error_model="numpy")
def _with_point(bounds: Bounds, x: float, y: float, z: float, counts: bool) -> Bounds:
    """Bounds that hold the point's picture as well, where it counts."""
    right, up = x / z, y / z
    return (
        min(bounds[0], right if counts else np.inf),
        max(bounds[1], right if counts else -np.inf),
        min(bounds[2], up if counts else np.inf),
        max(bounds[3], up if counts else -np.inf),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _with_side(bounds: Bounds, p: Vector, q: Vector) -> Bounds:
    """Bounds that hold what is before the camera of the side from p to q, without q."""
    bounds = _with_point(bounds, p[0], p[1], p[2], p[2] > _NEAR)
    share = (_NEAR - p[2]) / (q[2] - p[2])
    x, y = p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])
    return _with_point(bounds, x, y, _NEAR, (p[2] > _NEAR) != (q[2] > _NEAR))


@njit(cache=True, nogil=True, error_model="numpy")
def _write_line(prepared: NDArray[np.float64], edge: int, column: int, line: Vector) -> None:
    prepared[LINE + 3 * edge, column] = line[0]
    prepared[LINE + 3 * edge + 1, column] = line[1]
    prepared[LINE + 3 * edge + 2, column] = line[2]
    prepared[CROSSING + edge, column] = -1 / line[0] if abs(line[0]) > _FLAT else -_FAR_OFF


@njit(cache=True, nogil=True, error_model="numpy")
def prepare_cluster(corners: int, view: View, window: Window, prepared_address: int) -> None:
    """Write the rows of a cluster's triangles. Addresses of (9, CLUSTER) float32 and of (ROWS, CLUSTER) float64.

    The arrays' shapes are constants, so that the loop becomes vector instructions.
    """
    places = array_at(corners, (9, CLUSTER), np.float32)
    prepared = array_at(prepared_address, (ROWS, CLUSTER), np.float64)
    for column in range(CLUSTER):
        p = to_camera(view, places[0, column], places[1, column], places[2, column])
        q = to_camera(view, places[3, column], places[4, column], places[5, column])
        r = to_camera(view, places[6, column], places[7, column], places[8, column])
        normal = _cross((q[0] - p[0], q[1] - p[1], q[2] - p[2]), (r[0] - p[0], r[1] - p[1], r[2] - p[2]))
        volume = normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2]
        side = -1.0 if volume < 0 else 1.0
        _write_line(prepared, 0, column, _on_picture(view, _cross(q, r), side))
        _write_line(prepared, 1, column, _on_picture(view, _cross(r, p), side))
        _write_line(prepared, 2, column, _on_picture(view, _cross(p, q), side))
        plane = _on_picture(view, normal, 1 / volume)
        prepared[PLANE, column], prepared[PLANE + 1, column], prepared[PLANE + 2, column] = plane
        prepared[SCALE, column] = abs(1 / volume)
        nearest, farthest = min(p[2], min(q[2], r[2])), max(p[2], max(q[2], r[2]))
        prepared[FARTHEST, column] = 1 / farthest
        prepared[NEAREST, column] = 1 / max(nearest, _NEAR)

        bounds = (np.inf, -np.inf, np.inf, -np.inf)
        bounds = _with_side(_with_side(_with_side(bounds, p, q), q, r), r, p)
        left = np.ceil(max(window[0], bounds[0] / view[5] + view[6] - _MARGIN))
        right = np.floor(min(window[1], bounds[1] / view[5] + view[6] + _MARGIN))
        top = np.ceil(max(window[2], view[7] - bounds[3] / view[5] - _MARGIN))
        bottom = np.floor(min(window[3], view[7] - bounds[2] / view[5] + _MARGIN))
        # A triangle of no area, or seen along its plane, has no picture.
        seen = (left <= right) & (abs(1 / volume) < _FAR_OFF)
        prepared[LEFT, column], prepared[RIGHT, column] = left, right
        prepared[TOP, column] = top if seen else 1.0
        prepared[BOTTOM, column] = bottom if seen else 0.0
