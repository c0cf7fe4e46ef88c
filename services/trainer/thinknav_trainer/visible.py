"""Which objects a frame shows, and where: read off its depth image.

Some of the pixels are put back into the room and given to the object whose box they lie in. It takes nothing but the
boxes, so that it works in imported scans as well. It knows nothing of how objects look.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render import Camera
from thinknav_sim.render.renderer import NOTHING_DEPTH
from thinknav_sim.scene import Scene

RAYS = 32  # along each side of the picture
GROWN_M = 0.03  # boxes are taken this much wider: depth is read in the middle of pixels
FLOOR_M = 0.025  # what lies no higher over a box's bottom is the floor it stands on
FLAT_M = 0.1  # a lower object, a rug say, is seen for its top


@dataclass(frozen=True)
class SeenObject:
    """An object in a frame.

    bearing: radians to the middle of what is seen of it, left positive, 0 straight ahead.
    distance: metres along the floor to the nearest part that is seen. share: of the picture that it fills, 0 to 1.
    object_id: its index in `Scene.objects`.
    """

    category: str
    bearing: float
    distance: float
    share: float
    object_id: int


@dataclass(frozen=True)
class FramePoints:
    """What R of a frame's pixels show.

    points: (3, R) float32: x, y and z of where each ray ends, metres. left, forward: (R,) float32, metres to the left
    of the camera and ahead of it. rays: how many were looked at; R of them met something.
    """

    points: NDArray[np.float32]
    left: NDArray[np.float32]
    forward: NDArray[np.float32]
    rays: int


def objects_in_view(
    scene: Scene,
    poses: NDArray[np.float64],
    depth: NDArray[np.float32],
    camera: Camera,
    *,
    least_share: float = 0.003,
) -> list[tuple[SeenObject, ...]]:
    """The objects that each of N frames shows, the largest in the picture first.

    poses: (N, 4). depth: (N, H, W), metres along the optical axis as renderers give them, of this camera.
    least_share: objects that fill less of the picture are left out; one ray of about 1,000 is 0.001.
    Raises ValueError for shapes that do not fit.
    """
    return objects_at(scene, frame_points(poses, depth, camera), least_share)


def objects_at(scene: Scene, frames: Sequence[FramePoints], least_share: float) -> list[tuple[SeenObject, ...]]:
    """The objects that frames show, of which the points are known; see `objects_in_view`."""
    if not scene.objects:
        return [()] * len(frames)
    boxes = ObjectBoxes(scene)
    return [_summary(scene, frame, boxes.owners(frame.points), least_share) for frame in frames]


def frame_points(poses: NDArray[np.float64], depth: NDArray[np.float32], camera: Camera) -> list[FramePoints]:
    """Put about a thousand pixels of each frame back into the room. Arguments and errors are `objects_in_view`'s."""
    if depth.shape != (len(poses), camera.height, camera.width):
        raise ValueError(
            f"depth of {len(poses)} poses and this camera must have shape "
            f"{(len(poses), camera.height, camera.width)}, not {depth.shape}"
        )
    (rows, columns), leftward, upward = camera_rays(camera, RAYS)
    frames = []
    for (x, y, z, heading), image in zip(poses.tolist(), depth[:, rows, columns], strict=True):
        there = image != NOTHING_DEPTH
        forward = image[there]
        left, up = leftward[there] * forward, upward[there] * forward
        sine, cosine = math.sin(heading), math.cos(heading)
        eye = y + camera.elevation
        points = np.stack([x - cosine * left - sine * forward, eye + up, z + sine * left - cosine * forward])
        frames.append(FramePoints(points.astype(np.float32), left, forward, image.size))
    return frames


def camera_rays(
    camera: Camera, rays: int
) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64]], NDArray[np.float32], NDArray[np.float32]]:
    """Pixels (rows, columns), spread evenly, and how far each looks to the left and up at depth 1; row by row.

    rays: along each side of the picture, as far as it has so many pixels.
    """
    height, width = min(rays, camera.height), min(rays, camera.width)
    row = ((np.arange(height) + 0.5) * camera.height / height).astype(np.int64)
    column = ((np.arange(width) + 0.5) * camera.width / width).astype(np.int64)
    rows, columns = (axis.ravel() for axis in np.meshgrid(row, column, indexing="ij"))
    left = (camera.width / 2 - columns - 0.5) / camera.focal_length
    up = (camera.height / 2 - rows - 0.5) / camera.focal_length
    return (rows, columns), left.astype(np.float32), up.astype(np.float32)


class ObjectBoxes:
    """The boxes of a scene's objects, the smallest first: a vase on a table lies in both their boxes.

    A scene without objects has none.
    """

    def __init__(self, scene: Scene) -> None:
        low = np.stack([instance.box.low for instance in scene.objects])
        high = np.stack([instance.box.high for instance in scene.objects])
        size = high - low
        bottom = np.where(size[:, 1] < FLAT_M, low[:, 1] - GROWN_M, low[:, 1] + FLOOR_M)
        low, high = low - GROWN_M, high + GROWN_M
        low[:, 1] = bottom
        self._order = np.argsort(np.prod(size + 2 * GROWN_M, axis=1), kind="stable")
        self._low = low[self._order].astype(np.float32)
        self._high = high[self._order].astype(np.float32)

    def owners(self, points: NDArray[np.float32]) -> NDArray[np.int64]:
        """The object that each of R points (3, R) belongs to, -1 for none."""
        inside = np.ones((len(self._order), points.shape[1]), np.bool_)
        for axis in range(3):
            inside &= points[axis] >= self._low[:, axis, None]
            inside &= points[axis] <= self._high[:, axis, None]
        first = inside.argmax(axis=0)
        return np.where(inside[first, np.arange(points.shape[1])], self._order[first], -1)


def _summary(scene: Scene, frame: FramePoints, owners: NDArray[np.int64], least_share: float) -> tuple[SeenObject, ...]:
    """One frame's objects, from the owner of each point."""
    counts = np.bincount(owners[owners >= 0], minlength=len(scene.objects))
    found = []
    for object_id in np.flatnonzero(counts >= max(1.0, least_share * frame.rays)).tolist():
        mine = owners == object_id
        left, forward = frame.left[mine], frame.forward[mine]
        bearing = float(np.arctan2(left, forward).mean())
        distance = float(np.hypot(left, forward).min())
        share = float(counts[object_id]) / frame.rays
        found.append(SeenObject(scene.objects[object_id].category, bearing, distance, share, object_id))
    return tuple(sorted(found, key=lambda seen: (-seen.share, seen.object_id)))
