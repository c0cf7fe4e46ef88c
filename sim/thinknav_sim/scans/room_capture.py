"""Objects from a headset's room capture: a JSON of labelled boxes (WebXR plane and mesh detection, Meta's labels).

A triangle belongs to an object when its centroid lies in the object's box.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scans.labels import category_of
from thinknav_sim.scans.mesh import Mesh
from thinknav_sim.scene import Box, ObjectInstance, SceneError

# Boxes are fitted a little too tightly, and planes (doors, pictures) have no thickness at all.
_SLACK_M = 0.03
_PLANE_DEPTH_M = 0.15
# The floor that a box stands on is not a part of the object.
_SOLE_M = 0.05


@dataclass(frozen=True)
class LabelledBox:
    """An oriented box. position (3,), rotation (3, 3) to the world; low, high: (3,) in its own axes. Metres, y up."""

    category: str
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    flat: bool

    def corners(self) -> NDArray[np.float64]:
        """(8, 3) in the world."""
        bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
        corners: NDArray[np.float64] = np.where(bits, self.high, self.low) @ self.rotation.T + self.position
        return corners

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (N, 3) of the world lie in it."""
        local = (points - self.position) @ self.rotation
        slack = np.full(3, _SLACK_M)
        inside: NDArray[np.bool_] = np.all((local >= self.low - slack) & (local <= self.high + slack), axis=1)
        return inside


def read_room_capture(path: Path) -> list[LabelledBox]:
    """The boxes of a room capture; planes only where no box of the same category is. Raises SceneError."""
    try:
        entities = json.loads(path.read_text(encoding="utf-8"))["spatialEntities"]
        boxes = [box for entity in entities if (box := _box(entity)) is not None]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise SceneError(
            f"{path} is not a room capture (JSON with spatialEntities): {type(error).__name__}: {error}"
        ) from None
    solid = [box for box in boxes if not box.flat]
    return solid + [
        box
        for box in boxes
        if box.flat
        and not any(other.category == box.category and other.holds(box.position[None])[0] for other in solid)
    ]


def _box(entity: dict[str, Any]) -> LabelledBox | None:
    category = category_of(entity.get("semanticLabel_META", ""))
    shape = entity.get("bounded3D_META") or entity.get("bounded2D_META")
    if category is None or shape is None:
        return None
    place = entity["locatable_META"]
    x, y, z, w = (float(place["orientation"][key]) for key in "xyzw")
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    position = np.array([float(place["position"][key]) for key in "xyz"])
    offset, extent = shape["offset"], shape["extent"]
    flat = "z" not in offset
    low = np.array([offset["x"], offset["y"], 0.0 if flat else offset["z"]], np.float64)
    size = np.array([extent["width"], extent["height"], 0.0 if flat else extent["depth"]], np.float64)
    if flat:  # a plane's second direction is its z axis, its normal is y
        low[1:], size[1:] = (-_PLANE_DEPTH_M, low[1]), (2 * _PLANE_DEPTH_M, size[1])
    if not all(np.isfinite(part).all() for part in (position, low, size, rotation)):
        raise ValueError(f"a box of {category} is not finite")
    return LabelledBox(category, position, rotation, low, low + size, flat)


def objects_in_boxes(mesh: Mesh, boxes: list[LabelledBox]) -> tuple[tuple[ObjectInstance, ...], NDArray[np.int32]]:
    """The objects of labelled boxes in a mesh of metres, y up, and the object of each triangle (T,), -1 for none.

    Where boxes overlap, the smaller one has the triangle. A box that holds no triangle is kept, as an object that
    nobody can see.
    """
    owners = np.full(len(mesh.triangles), -1, np.int32)
    centroids, normals = mesh.centroids(), mesh.normals()[0]
    level = np.abs(normals[:, 1]) > 0.8
    objects = []
    for index, box in enumerate(boxes):
        corners = box.corners()
        objects.append(ObjectInstance(index, box.category, Box(corners.min(axis=0), corners.max(axis=0))))
    for index in sorted(range(len(boxes)), key=lambda i: -float(np.prod(boxes[i].high - boxes[i].low))):
        sole = level & (centroids[:, 1] < objects[index].box.low[1] + _SOLE_M)
        owners[boxes[index].holds(centroids) & ~sole] = index
    return tuple(objects), owners
