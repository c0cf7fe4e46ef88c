"""The reference renderer, and the one to fall back to: Open3D's RaycastingScene on the CPU.

Several times slower than `embree`, and simple enough to be believed. Open3D is imported when the first
renderer is made, since that takes most of a second and needs libraries of the operating system.
"""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.arguments import SceneTable, check_rays, check_views
from thinknav_sim.render.camera import Camera
from thinknav_sim.render.known_answer import check_known_answer
from thinknav_sim.render.renderer import NOTHING_DEPTH, ClosedAtExit, Hits, RendererUnavailable
from thinknav_sim.scene import Scene

# Shared libraries that Open3D loads from the system, and the Debian packages that hold them.
_DEBIAN_PACKAGES = {
    "libusb-1.0": "libusb-1.0-0",
    "libGL.so": "libgl1",
    "libEGL": "libegl1",
    "libX11.so": "libx11-6",
    "libgomp": "libgomp1",
    "libudev": "libudev1",
}


@dataclass(frozen=True)
class _CastScene:
    """raycasting: an open3d.t.geometry.RaycastingScene. corner_colors: (T, 3, 3) float32, 0 to 255.

    corner_uv: (T, 3, 2) float32. triangle_textures: (T,) int32, index into textures, or -1.
    """

    raycasting: Any
    corner_colors: NDArray[np.float32]
    corner_uv: NDArray[np.float32]
    triangle_textures: NDArray[np.int32]
    textures: tuple[NDArray[np.uint8], ...]


class Open3DRenderer(ClosedAtExit):
    """Draws on the CPU with Open3D; see `Renderer` for what its methods take and give.

    threads: how many cast rays, 0 for all cores.

    Raises RendererUnavailable when Open3D cannot be imported, or does not give a known scene's known answer.
    """

    def __init__(self, threads: int = 0) -> None:
        if threads < 0:
            raise ValueError(f"threads must be positive, or 0 for all cores, not {threads}")
        self._open3d = _import_open3d()
        self._threads = threads
        self._scenes = SceneTable[_CastScene]()
        self._closed = False
        check_known_answer(self)

    def add_scene(self, scene: Scene) -> int:
        """See `Renderer.add_scene`."""
        if self._closed:
            raise RuntimeError("the renderer is closed")
        tensor = self._open3d.core.Tensor
        raycasting = self._open3d.t.geometry.RaycastingScene(nthreads=self._threads)
        raycasting.add_triangles(
            tensor(np.ascontiguousarray(scene.vertices)), tensor(scene.triangles.astype(np.uint32))
        )
        colors = scene.colors[scene.triangles].astype(np.float32)
        if scene.uv is None or scene.triangle_textures is None:
            corner_uv, owners = np.empty((0, 3, 2), np.float32), np.full(len(scene.triangles), -1, np.int32)
        else:
            corner_uv, owners = scene.uv[scene.triangles], scene.triangle_textures
        return self._scenes.add(_CastScene(raycasting, colors, corner_uv, owners, scene.textures))

    def remove_scene(self, scene_id: int) -> None:
        """See `Renderer.remove_scene`."""
        self._scenes.remove(scene_id)

    def render(
        self, scene_ids: NDArray[np.int64], poses: NDArray[np.float64], camera: Camera
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """See `Renderer.render`."""
        ids, places = check_views(scene_ids, poses)
        scenes = {scene_id: self._scenes[scene_id] for scene_id in sorted(set(ids.tolist()))}
        rgb = np.zeros((len(ids), camera.height, camera.width, 3), np.uint8)
        depth = np.full((len(ids), camera.height, camera.width, 1), NOTHING_DEPTH, np.float32)
        for scene_id, scene in scenes.items():
            views = np.flatnonzero(ids == scene_id)
            rgb[views], depth[views] = self._draw(scene, _camera_rays(places[views], camera))
        low, high, span = camera.depth_scale
        return rgb, (np.clip(depth, low, high) - low) / span

    def cast(self, scene_id: int, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """See `Renderer.cast`."""
        scene = self._scenes[scene_id]
        starts, ways = check_rays(origins, directions)
        hits = self._cast(scene, np.concatenate([starts, ways], axis=1))
        # Open3D's id of nothing is the largest uint32, which is -1 as int32.
        return Hits(hits["t_hit"].numpy().copy(), hits["primitive_ids"].numpy().astype(np.int32))

    def close(self) -> None:
        """See `Renderer.close`."""
        self._closed = True
        self._scenes.clear()

    def _draw(self, scene: _CastScene, rays: NDArray[np.float32]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """The rgb (..., 3) and depth (..., 1) of rays (..., 6) whose distances are depths."""
        hits = self._cast(scene, rays)
        distance = hits["t_hit"].numpy()[..., None]
        met = np.isfinite(distance)
        triangles = np.where(met[..., 0], hits["primitive_ids"].numpy(), 0)
        weights = hits["primitive_uvs"].numpy()
        rgb = np.where(met, _interpolate(scene.corner_colors[triangles], weights) + np.float32(0.5), 0).astype(np.uint8)
        for index, texture in enumerate(scene.textures):
            pixels = met[..., 0] & (scene.triangle_textures[triangles] == index)
            place = _interpolate(scene.corner_uv[triangles[pixels]], weights[pixels])
            size = np.array([texture.shape[1], texture.shape[0]])
            across, down = np.minimum(((place - np.floor(place)) * size).astype(np.int64), size - 1).T
            rgb[pixels] = texture[down, across]
        return rgb, np.where(met, distance, np.float32(NOTHING_DEPTH))

    def _cast(self, scene: _CastScene, rays: NDArray[np.float32]) -> Any:
        return scene.raycasting.cast_rays(self._open3d.core.Tensor(rays), nthreads=self._threads)


def _interpolate(corners: NDArray[np.float32], weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (..., C) between a triangle's corners (..., 3, C), at the hit's u and v (..., 2)."""
    u, v = weights[..., :1], weights[..., 1:]
    between: NDArray[np.float32] = (1 - u - v) * corners[..., 0, :] + u * corners[..., 1, :] + v * corners[..., 2, :]
    return between


def _camera_rays(poses: NDArray[np.float64], camera: Camera) -> NDArray[np.float32]:
    """The rays (N, H, W, 6) through N views' pixels: origin, and direction of forward length 1."""
    right = (np.arange(camera.width) + 0.5 - camera.width / 2) / camera.focal_length
    up = (camera.height / 2 - np.arange(camera.height) - 0.5) / camera.focal_length
    sine, cosine = np.sin(poses[:, 3, None, None]), np.cos(poses[:, 3, None, None])
    rays = np.empty((len(poses), camera.height, camera.width, 6), np.float32)
    rays[..., :3] = (poses[:, :3] + (0, camera.elevation, 0))[:, None, None]
    rays[..., 3] = right * cosine - sine
    rays[..., 4] = up[:, None]
    rays[..., 5] = -right * sine - cosine
    return rays


def _import_open3d() -> ModuleType:
    """Raises RendererUnavailable that names the package to install."""
    try:
        import open3d
    except (ImportError, OSError) as error:
        for library, package in _DEBIAN_PACKAGES.items():
            if library in str(error):
                remedy = f"apt install {package}"
                break
        else:
            remedy = "pip install open3d-cpu"
        raise RendererUnavailable(f"Open3D cannot be imported ({error}): {remedy}") from error
    module: ModuleType = open3d
    return module
