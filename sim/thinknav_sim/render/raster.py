"""The renderer for CPUs that draws triangles instead of casting rays: a z-buffer, by compiled loops.

A row of a triangle's pixels takes a few instructions where each ray takes hundreds. Another renderer casts rays, and
draws the scenes of so many triangles that most are smaller than a pixel.
Knows nothing of tasks. Threads are numba's.
"""

import functools

import numba
import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.arguments import SceneTable, check_views
from thinknav_sim.render.camera import Camera
from thinknav_sim.render.known_answer import check_known_answer
from thinknav_sim.render.picture_memory import PictureMemory
from thinknav_sim.render.raster_clusters import Clusters, cluster
from thinknav_sim.render.raster_kernels import SPAN, draw_views
from thinknav_sim.render.renderer import ClosedAtExit, Hits, Renderer
from thinknav_sim.render.threads import PARALLEL_REGION
from thinknav_sim.scene import Scene

# Scenes of more triangles are drawn by casting rays, which takes less time from about here on.
MAX_TRIANGLES = 1_000_000


class _Clustered:
    """A scene as the kernels want it, and as the caster of rays knows it once it is asked."""

    def __init__(self, scene: Scene, caster: Renderer) -> None:
        self._scene = scene
        self._caster = caster
        self.is_large = len(scene.triangles) > MAX_TRIANGLES

    @functools.cached_property
    def _clusters(self) -> Clusters:
        return cluster(self._scene)

    @functools.cached_property
    def kernel_row(self) -> list[int]:
        """What `draw_views` takes, asked for once a view."""
        return self._clusters.kernel_row

    @functools.cached_property
    def triangles(self) -> int:
        """How many numbers triangles have, empty places of clusters included."""
        return len(self._clusters.colors)

    @functools.cached_property
    def caster_id(self) -> int:
        return self._caster.add_scene(self._scene)

    def remove(self) -> None:
        if "caster_id" in vars(self):
            self._caster.remove_scene(self.caster_id)


class RasterRenderer(ClosedAtExit):
    """Draws on the CPU by rasterising; see `Renderer` for what its methods take and give.

    caster: casts the rays and draws scenes of more than MAX_TRIANGLES; closed with this renderer.

    Raises RendererUnavailable when it does not give a known scene's known answer.
    """

    def __init__(self, caster: Renderer) -> None:
        self.caster = caster
        self._scenes = SceneTable[_Clustered]()
        self._memory = PictureMemory()
        self._closed = False
        self._keys = np.empty((0, 0, 0), np.int64)
        self._planes = (np.empty((0, 0, 9), np.float32), np.empty((0, 0), np.int32))
        check_known_answer(self)

    def add_scene(self, scene: Scene) -> int:
        """See `Renderer.add_scene`."""
        if self._closed:
            raise RuntimeError("the renderer is closed")
        return self._scenes.add(_Clustered(scene, self.caster))

    def remove_scene(self, scene_id: int) -> None:
        """See `Renderer.remove_scene`."""
        self._scenes.remove(scene_id).remove()

    def render(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """See `Renderer.render`."""
        ids, places = check_views(scene_ids, poses)
        scenes = [self._scenes[scene_id] for scene_id in ids.tolist()]
        large = np.array([scene.is_large for scene in scenes], np.bool_)
        if large.any():
            return self._render_mixed(scenes, large, ids, places, camera)
        rgb = self._memory.empty((len(ids), camera.height, camera.width, 3), np.uint8)
        depth = self._memory.empty((len(ids), camera.height, camera.width, 1), np.float32)
        if scenes:
            self._draw(scenes, places, camera, rgb, depth)
        return rgb, depth

    def cast(self, scene_id: int, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """See `Renderer.cast`."""
        return self.caster.cast(self._scenes[scene_id].caster_id, origins, directions)

    def close(self) -> None:
        """See `Renderer.close`."""
        self._closed = True
        self._scenes.clear()
        self.caster.close()

    def _render_mixed(
        self,
        scenes: list[_Clustered],
        large: NDArray[np.bool_],
        ids: NDArray[np.int64],
        poses: NDArray[np.float64],
        camera: Camera,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Draw N views of which some show large scenes."""
        casters = np.array([scene.caster_id for scene in scenes if scene.is_large], np.int64)
        drawn = self.caster.render(casters, poses[large], camera)
        if large.all():
            return drawn
        rest = self.render(ids[~large], poses[~large], camera)
        rgb = self._memory.empty((len(ids), *rest[0].shape[1:]), np.uint8)
        depth = self._memory.empty((len(ids), *rest[1].shape[1:]), np.float32)
        rgb[large], depth[large] = drawn
        rgb[~large], depth[~large] = rest
        return rgb, depth

    def _draw(
        self,
        scenes: list[_Clustered],
        poses: NDArray[np.float64],
        camera: Camera,
        rgb: NDArray[np.uint8],
        depth: NDArray[np.float32],
    ) -> None:
        rows = np.array([scene.kernel_row for scene in scenes], np.int64)
        threads = numba.get_num_threads()
        # Where there are fewer views than threads, several share a view.
        bands = min(-(-threads // len(scenes)), camera.height)
        places = max(scene.triangles for scene in scenes)
        self._make_room((threads, -(-camera.height // bands), camera.width + SPAN), places)
        lens = (1 / camera.focal_length, float(camera.elevation))
        with PARALLEL_REGION:
            flat = depth.reshape(rgb.shape[:3])
            draw_views(rows, poses, lens, camera.depth_scale, bands, self._keys, self._planes, rgb, flat)

    def _make_room(self, shape: tuple[int, int, int], places: int) -> None:
        """Scratch memory for keys of a shape and the planes of so many triangles, kept from call to call."""
        if self._keys.shape != shape:
            self._keys = np.empty(shape, np.int64)
        if self._planes[1].shape[0] != shape[0] or self._planes[1].shape[1] <= places:
            size = (shape[0], places + 1)
            self._planes = (np.empty((*size, 9), np.float32), np.empty(size, np.int32))
