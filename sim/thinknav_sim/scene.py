"""A scene: the triangles of a home, their colours, and the objects that stand in it.

Frame (Habitat's): metres, y up, -z forward, right-handed. A scene knows nothing of cameras, agents or episodes;
`render` draws it, `navigation` finds where one can walk in it.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

# The six goals of HM3D ObjectNav, in the order of Habitat's task category ids.
GOAL_CATEGORIES: tuple[str, ...] = ("chair", "bed", "plant", "toilet", "tv_monitor", "sofa")

# A home is some tens of metres wide; a larger one was given in other units (millimetres, say).
MAX_EXTENT_M = 1_000.0
# Texture coordinates beyond this have no digits left, as float32, for a place on the texture.
MAX_UV = 1e6


class SceneError(ValueError):
    """A scene that cannot be used; the message names the scene and what is wrong with it."""


@dataclass(frozen=True)
class Box:
    """An axis-aligned box.

    low, high: (3,) float64, metres.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def center(self) -> NDArray[np.float64]:
        return (self.low + self.high) / 2


@dataclass(frozen=True)
class ObjectInstance:
    """One object: its id (its index in `Scene.objects`), category ("chair") and bounding box."""

    object_id: int
    category: str
    box: Box


@dataclass(frozen=True)
class Room:
    """A room's function ("kitchen") and its floor rectangle: x0, z0, x1, z1 in metres."""

    function: str
    bounds: tuple[float, float, float, float]


@dataclass(frozen=True)
class Scene:
    """The geometry of one home and the objects in it. Immutable, so that many agents share it.

    name: what people call it, unique within a set of scenes.
    vertices: (V, 3) float32, metres.
    triangles: (T, 3) int32, indices into vertices; either winding order.
    colors: (V, 3) uint8 sRGB, one for each vertex, lighting included; interpolated over each triangle.
    triangle_objects: (T,) int32, the object_id that a triangle belongs to, -1 for the building and clutter.
    level_floors: each floor has one height, and objects fill the footprints of their boxes. Not so in scans, where the
        grid follows a floor over its steps.
    floors: heights of the walkable floors, metres.
    textures: images (H, W, 3) uint8 sRGB, row 0 at v = 0. A textured triangle has its texture's nearest texel alone for
    a colour, and textures repeat.
    uv: (V, 2) float32, places on the texture in units of its size, u to the right and v down; goes with textures.
    triangle_textures: (T,) int32, index into textures, -1 for a triangle with vertex colours; goes with textures.

    Raises SceneError when the arrays do not make a scene one can stand in.
    """

    name: str
    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    colors: NDArray[np.uint8]
    triangle_objects: NDArray[np.int32]
    objects: tuple[ObjectInstance, ...] = ()
    level_floors: bool = True
    floors: tuple[float, ...] = (0.0,)
    rooms: tuple[Room, ...] = field(default=())
    textures: tuple[NDArray[np.uint8], ...] = ()
    uv: NDArray[np.float32] | None = None
    triangle_textures: NDArray[np.int32] | None = None

    def __post_init__(self) -> None:
        self._check_array("vertices", self.vertices, (None, 3), np.float32)
        self._check_array("triangles", self.triangles, (None, 3), np.int32)
        self._check_array("colors", self.colors, (len(self.vertices), 3), np.uint8)
        self._check_array("triangle_objects", self.triangle_objects, (len(self.triangles),), np.int32)
        if not len(self.triangles):
            raise SceneError(f"scene {self.name!r} has no triangles")
        if not np.isfinite(self.vertices).all():
            raise SceneError(f"scene {self.name!r} has vertices that are NaN or infinite")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise SceneError(
                f"scene {self.name!r} has a triangle that names vertex {self.triangles.max()} of {len(self.vertices)}"
            )
        extent = float(np.ptp(self.vertices, axis=0).max())
        if not 0 < extent <= MAX_EXTENT_M:
            raise SceneError(f"scene {self.name!r} is {extent:.3g} m wide; is it in metres?")
        if self.triangle_objects.min() < -1 or self.triangle_objects.max() >= len(self.objects):
            raise SceneError(f"scene {self.name!r} has a triangle of an object that it does not list")
        for index, instance in enumerate(self.objects):
            if instance.object_id != index:
                raise SceneError(f"scene {self.name!r}: object {instance.object_id} stands at index {index}")
        self._check_textures()

    def _check_textures(self) -> None:
        if self.uv is None or self.triangle_textures is None:
            if self.textures or self.uv is not None or self.triangle_textures is not None:
                raise SceneError(f"scene {self.name!r}: textures, uv and triangle_textures go together")
            return
        self._check_array("uv", self.uv, (len(self.vertices), 2), np.float32)
        self._check_array("triangle_textures", self.triangle_textures, (len(self.triangles),), np.int32)
        for index, texture in enumerate(self.textures):
            self._check_array(f"texture {index}", texture, (None, None, 3), np.uint8)
            if not texture.size:
                raise SceneError(f"scene {self.name!r}: texture {index} has no texels")
        if not np.isfinite(self.uv).all():
            raise SceneError(f"scene {self.name!r} has texture coordinates (uv) that are NaN or infinite")
        if np.abs(self.uv).max(initial=0) > MAX_UV:
            raise SceneError(f"scene {self.name!r} has texture coordinates (uv) beyond {MAX_UV:g}, which name no texel")
        low, high = int(self.triangle_textures.min()), int(self.triangle_textures.max())
        if low < -1 or high >= len(self.textures):
            wrong = low if low < -1 else high
            raise SceneError(
                f"scene {self.name!r} has a triangle that names texture {wrong}, and {len(self.textures)} textures"
            )

    def _check_array(self, name: str, array: NDArray[np.generic], shape: tuple[int | None, ...], dtype: type) -> None:
        fits = array.ndim == len(shape) and all(
            want in (None, have) for want, have in zip(shape, array.shape, strict=True)
        )
        if not fits or array.dtype != dtype:
            wanted = tuple("any" if size is None else size for size in shape)
            raise SceneError(
                f"scene {self.name!r}: {name} must be {np.dtype(dtype).name} of shape {wanted}, "
                f"not {array.dtype} of shape {array.shape}"
            )

    @property
    def bounds(self) -> Box:
        """The box around all vertices."""
        return Box(self.vertices.min(axis=0).astype(np.float64), self.vertices.max(axis=0).astype(np.float64))

    def triangles_of(self, object_id: int) -> NDArray[np.float32]:
        """The corners (T, 3, 3) of an object's triangles, metres."""
        corners: NDArray[np.float32] = self.vertices[self.triangles[self.triangle_objects == object_id]]
        return corners

    def objects_of(self, category: str) -> tuple[ObjectInstance, ...]:
        """The instances of a category, in the order of their ids."""
        return tuple(instance for instance in self.objects if instance.category == category)
