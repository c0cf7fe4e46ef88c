"""What a renderer is. The simulator draws through this.

`raster`, `embree`, `open3d_raycasting` and `warp_raycasting` implement it.
"""

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.camera import Camera
from thinknav_sim.scene import Scene

# Pixels and rays that meet nothing: black, and this depth in metres.
NOTHING_DEPTH = 0.0


class RendererUnavailable(RuntimeError):
    """A renderer that cannot run on this machine; the message says why, and what to install."""


@dataclass(frozen=True)
class Hits:
    """Where R rays met a scene.

    distance: (R,) float32, in units of the ray's direction, inf where it met nothing.
    triangle: (R,) int32, index into `Scene.triangles`, -1 where it met nothing.
    """

    distance: NDArray[np.float32]
    triangle: NDArray[np.int32]


class Renderer(Protocol):
    """Draws scenes from poses. One renderer for each calling thread: its scratch memory is its own.

    A pose is (x, y, z, heading): the agent's feet in metres and its heading in radians, counter-clockwise
    seen from above, so that turning left adds. Forward is (-sin h, 0, -cos h): along -z at heading 0.
    """

    def add_scene(self, scene: Scene) -> int:
        """Build what drawing the scene needs; returns its id. Raises RuntimeError on a closed renderer."""

    def remove_scene(self, scene_id: int) -> None:
        """Free it. Raises KeyError for an id that is not there."""

    def render(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Draw N views, of any mixture of scenes.

        scene_ids: (N,). poses: (N, 4).
        Returns rgb (N, H, W, 3) uint8 and depth (N, H, W, 1) float32: metres along the optical axis,
        `NOTHING_DEPTH` where there is nothing; or 0 to 1, by the camera's range.
        Raises KeyError for an unknown scene, ValueError for wrong shapes or poses that are not finite.
        """

    def cast(self, scene_id: int, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """First hits of R rays: origins (R, 3) in metres, directions (R, 3) of any length but zero.

        Raises KeyError for an unknown scene, ValueError for wrong shapes, values that are not finite, or a
        zero direction.
        """

    def close(self) -> None:
        """Free every scene. May be called twice; a renderer that is forgotten frees itself."""


class ClosedAtExit:
    """What makes a renderer one for `with`: it is closed where the block ends."""

    def close(self) -> None:
        """See `Renderer.close`."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()
