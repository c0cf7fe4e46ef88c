"""The renderer for CUDA GPUs: NVIDIA Warp's mesh queries, all views in one launch, pictures left on the GPU.

`draw` gives torch tensors where the meshes are; `render` and `cast` give NumPy arrays as every `Renderer` does. No
other file of the simulator imports torch; this one does when a tensor is asked for, and Warp when the first renderer is
made. Without a GPU Warp draws on the CPU, which is slow and there for tests.
"""

import logging
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.arguments import SceneTable, check_rays, check_views
from thinknav_sim.render.camera import Camera
from thinknav_sim.render.known_answer import check_known_answer
from thinknav_sim.render.renderer import ClosedAtExit, Hits, RendererUnavailable
from thinknav_sim.render.textures import pack_textures
from thinknav_sim.scene import Scene

if TYPE_CHECKING:
    import torch

# Rays end here: farther than any scene is wide, as MAX_EXTENT_M says, times the length of a corner ray.
_FAR = 1e5


@dataclass(frozen=True)
class _DeviceScene:
    """A scene in the device's memory, and the row of addresses by which the kernels find it.

    row: see `warp_kernels.Surface`. buffers: what the addresses point at, held here.
    """

    row: Any
    buffers: tuple[Any, ...]


class WarpRenderer(ClosedAtExit):
    """Draws with Warp; see `Renderer` for what its methods take and give.

    device: "cuda:0", "cpu", ...; None for Warp's default, the first GPU where there is one.

    Raises RendererUnavailable when Warp cannot be imported, has no such device, or does not give a known scene's known
    answer.
    """

    def __init__(self, device: str | None = None) -> None:
        self._warp, self._kernels = _import_warp()
        try:
            self._device = self._warp.get_device(device)
        except (ValueError, RuntimeError) as error:
            raise RendererUnavailable(f"Warp has no device {device!r}: {error}") from error
        self._scenes = SceneTable[_DeviceScene]()
        self._closed = False
        check_known_answer(self)

    @property
    def device(self) -> str:
        """Warp's name for where this renderer draws: "cuda:0", "cpu"."""
        return str(self._device)

    def add_scene(self, scene: Scene) -> int:
        """See `Renderer.add_scene`."""
        if self._closed:
            raise RuntimeError("the renderer is closed")
        return self._scenes.add(self._upload(scene))

    def remove_scene(self, scene_id: int) -> None:
        """See `Renderer.remove_scene`."""
        self._synchronize()
        self._scenes.remove(scene_id)

    def draw(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> "tuple[torch.Tensor, torch.Tensor]":
        """Draw N views as `render` does, into tensors on this renderer's device, ordered on torch's current stream.

        Returns rgb (N, H, W, 3) uint8 and depth (N, H, W, 1) float32. Raises as `render` does, and ImportError
        without torch.
        """
        import torch

        warp = self._warp
        ids, places = check_views(scene_ids, poses)
        shape = (len(ids), camera.height, camera.width)
        place = warp.device_to_torch(self._device)
        rgb = torch.empty((*shape, 3), dtype=torch.uint8, device=place)
        depth = torch.empty((*shape, 1), dtype=torch.float32, device=place)
        if self._device.is_cuda:
            with warp.ScopedStream(warp.stream_from_torch(torch.cuda.current_stream(rgb.device))):
                self._launch(ids, places, camera, warp.from_torch(rgb), warp.from_torch(depth))
        else:
            self._launch(ids, places, camera, warp.from_torch(rgb), warp.from_torch(depth))
        return rgb, depth

    def render(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """See `Renderer.render`."""
        ids, places = check_views(scene_ids, poses)
        shape = (len(ids), camera.height, camera.width)
        rgb = self._warp.empty((*shape, 3), dtype=self._warp.uint8, device=self._device)
        depth = self._warp.empty((*shape, 1), dtype=self._warp.float32, device=self._device)
        self._launch(ids, places, camera, rgb, depth)
        return rgb.numpy(), depth.numpy()

    def cast(self, scene_id: int, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """See `Renderer.cast`."""
        warp, row = self._warp, self._scenes[scene_id].row
        starts, ways = check_rays(origins, directions)
        distance = warp.empty(len(starts), dtype=warp.float32, device=self._device)
        triangle = warp.empty(len(starts), dtype=warp.int32, device=self._device)
        vectors = [warp.array(values, dtype=warp.vec3, device=self._device) for values in (starts, ways)]
        inputs = [warp.uint64(row.mesh), *vectors, distance, triangle]
        warp.launch(self._kernels.cast_rays, len(starts), inputs, device=self._device)
        return Hits(distance.numpy(), triangle.numpy())

    def close(self) -> None:
        """See `Renderer.close`."""
        self._closed = True
        self._synchronize()
        self._scenes.clear()

    def _launch(self, ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera, rgb: Any, depth: Any) -> None:
        warp = self._warp
        scenes = sorted(set(ids.tolist()))
        rows = [self._scenes[scene_id].row for scene_id in scenes]
        if not len(ids):
            return
        inputs = [
            warp.array(rows, dtype=self._kernels.Surface, device=self._device),
            warp.array(np.searchsorted(scenes, ids).astype(np.int32), dtype=warp.int32, device=self._device),
            warp.array(poses.astype(np.float32), dtype=warp.vec4, device=self._device),
            float(1 / camera.focal_length),
            float(camera.elevation),
            _FAR,
            *map(float, camera.depth_scale),
            rgb,
            depth,
        ]
        warp.launch(self._kernels.draw_views, (len(ids), camera.height, camera.width), inputs, device=self._device)

    def _upload(self, scene: Scene) -> _DeviceScene:
        warp, device = self._warp, self._device
        packed = pack_textures(scene)
        points = warp.array(np.ascontiguousarray(scene.vertices), dtype=warp.vec3, device=device)
        indices = warp.array(scene.triangles.ravel(), dtype=warp.int32, device=device)
        mesh = warp.Mesh(points=points, indices=indices)
        colors = warp.array(
            scene.colors[scene.triangles].astype(np.float32).reshape(-1, 3), dtype=warp.vec3, device=device
        )
        owners = packed.triangle_textures if len(packed.sizes) else np.full(len(scene.triangles), -1, np.int32)
        row = self._kernels.Surface()
        row.mesh = mesh.id
        row.colors = colors
        row.triangle_textures = warp.array(owners, dtype=warp.int32, device=device)
        row.corner_uv = warp.array(packed.corner_uv.reshape(-1, 2), dtype=warp.vec2, device=device)
        row.sizes = warp.array(packed.sizes, dtype=warp.int64, device=device)
        row.texels = warp.array(packed.texels, dtype=warp.uint8, device=device)
        return _DeviceScene(row, (mesh, colors))

    def _synchronize(self) -> None:
        """Wait for launches that may still read a scene about to be freed."""
        self._warp.synchronize_device(self._device)


def _import_warp() -> tuple[Any, Any]:
    """Warp and our kernels in it. Raises RendererUnavailable that names the package to install."""
    try:
        import warp
    except ImportError as error:
        raise RendererUnavailable(f"Warp cannot be imported ({error}): pip install 'thinknav[gpu]'") from error
    if "WARP_CACHE_PATH" not in os.environ and not warp.config.kernel_cache_dir:
        warp.config.kernel_cache_dir = str(Path.home() / ".cache" / "thinknav" / "warp")
    # What it says at the start belongs to nobody's output; the name of the setting changed between versions.
    warp.config.quiet = True
    warp.config.log_level = logging.WARNING
    warp.init()
    from thinknav_sim.render import warp_kernels

    return warp, warp_kernels
