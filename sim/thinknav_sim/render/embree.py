"""The renderer for CPUs: Embree's ray packets, filled and read by compiled loops. Knows nothing of tasks.

Threads are numba's: `numba.set_num_threads` and NUMBA_NUM_THREADS say how many draw.
"""

import functools

import numba
import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.arguments import SceneTable, check_rays, check_views
from thinknav_sim.render.camera import Camera
from thinknav_sim.render.embree_kernels import Surface, cast_rays, draw_views, packet_scratch, surface_row
from thinknav_sim.render.embree_library import PACKET_WIDTHS, EmbreeDevice, EmbreeScene
from thinknav_sim.render.known_answer import check_known_answer
from thinknav_sim.render.renderer import ClosedAtExit, Hits
from thinknav_sim.render.textures import pack_textures
from thinknav_sim.render.threads import PARALLEL_REGION
from thinknav_sim.scene import Scene

# RTCRayQueryFlags, the first word of RTCIntersectArguments, and RTC_FEATURE_FLAG_ALL, the second.
_INCOHERENT, _COHERENT = 0, 1 << 16
_ALL_FEATURES = 0xFFFFFFFF


class _BuiltScene:
    """A scene as the kernels want it; all views of it share it, and its last reference frees it."""

    def __init__(self, device: EmbreeDevice, scene: Scene) -> None:
        self._device = device
        self._scene = scene

    @functools.cached_property
    def picture(self) -> EmbreeScene:
        """Built when first drawn. It loses one pixel in millions, and saves time."""
        return self._device.build(self._scene, robust=False)

    @functools.cached_property
    def watertight(self) -> EmbreeScene:
        """Built when first cast at."""
        return self._device.build(self._scene, robust=True)

    @functools.cached_property
    def _surface(self) -> Surface:
        # The colours of a triangle's corners stand side by side for the cache's sake.
        return (self._scene.colors[self._scene.triangles], *pack_textures(self._scene))

    @functools.cached_property
    def kernel_row(self) -> tuple[int, ...]:
        """What `draw_views` takes: the scene's handle, addresses and lengths."""
        return (self.picture.handle, *surface_row(self._surface))


class EmbreeRenderer(ClosedAtExit):
    """Draws on the CPU with Embree 4; see `Renderer` for what its methods take and give.

    packet_width: rays intersected at once, 4, 8 or 16; 0 for the widest that this CPU has instructions for.

    Raises RendererUnavailable when Embree is not there, or does not give a known scene's known answer;
    ValueError for another packet width.
    """

    def __init__(self, packet_width: int = 0) -> None:
        if packet_width not in (0, *PACKET_WIDTHS):
            raise ValueError(f"packet_width must be one of {PACKET_WIDTHS}, or 0 for the best, not {packet_width}")
        self._device = EmbreeDevice()
        self.packet_width = packet_width or self._device.native_packet_width()
        self._intersect = self._device.intersect_address(self.packet_width)
        self._scenes = SceneTable[_BuiltScene]()
        self._coherent = _intersect_arguments(_COHERENT)
        self._incoherent = _intersect_arguments(_INCOHERENT)
        check_known_answer(self)

    def add_scene(self, scene: Scene) -> int:
        """See `Renderer.add_scene`."""
        self._device.check_open()
        return self._scenes.add(_BuiltScene(self._device, scene))

    def remove_scene(self, scene_id: int) -> None:
        """See `Renderer.remove_scene`."""
        self._scenes.remove(scene_id)

    def render(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """See `Renderer.render`."""
        ids, places = check_views(scene_ids, poses)
        scenes = np.array([self._scenes[scene_id].kernel_row for scene_id in ids.tolist()], np.int64).reshape(-1, 11)
        rgb = np.empty((len(ids), camera.height, camera.width, 3), np.uint8)
        depth = np.empty((len(ids), camera.height, camera.width, 1), np.float32)
        packets = packet_scratch(numba.get_num_threads(), self.packet_width)
        lens = (1 / camera.focal_length, float(camera.elevation))
        with PARALLEL_REGION:
            draw_views(
                self._intersect,
                self._coherent.ctypes.data,
                scenes,
                places,
                lens,
                camera.depth_scale,
                packets,
                rgb,
                depth,
            )
        return rgb, depth

    def cast(self, scene_id: int, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """See `Renderer.cast`."""
        scene = self._scenes[scene_id].watertight.handle
        starts, ways = check_rays(origins, directions)
        hits = Hits(np.empty(len(starts), np.float32), np.empty(len(starts), np.int32))
        packets = packet_scratch(numba.get_num_threads(), self.packet_width)
        arguments = self._incoherent.ctypes.data
        with PARALLEL_REGION:
            cast_rays(
                self._intersect,
                arguments,
                scene,
                starts,
                ways,
                packets,
                hits.distance,
                hits.triangle,
            )
        return hits

    def close(self) -> None:
        """See `Renderer.close`."""
        self._scenes.clear()
        self._device.close()


def _intersect_arguments(flags: int) -> NDArray[np.uint32]:
    """An RTCIntersectArguments with these flags, and neither context nor callbacks."""
    arguments = np.zeros(16, np.uint32)
    arguments[:2] = flags, _ALL_FEATURES
    return arguments
