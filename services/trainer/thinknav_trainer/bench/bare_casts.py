"""The casting of rays alone, by Embree's packets and by Open3D: rays ready made, no colours, nothing kept.

What Embree takes here is the limit of any renderer that calls it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thinknav_sim.render import Camera
from thinknav_sim.render.embree_kernels import packet_scratch
from thinknav_sim.render.embree_library import EmbreeDevice
from thinknav_sim.render.native_call import intersect_packet
from thinknav_sim.scene import Scene

# Rows of Embree's RTCRayHitK, and of packet_scratch behind them; RTC_RAY_QUERY_FLAG_COHERENT, RTC_FEATURE_FLAG_ALL.
_ORIGIN, _DIRECTION, _FAR, _MASK, _GEOMETRY, _VALID = 0, 4, 8, 9, 18, 24
_COHERENT, _ALL_FEATURES = 1 << 16, 0xFFFFFFFF
_TILE = {16: (4, 4), 8: (2, 4), 4: (2, 2)}


def view_rays(poses: NDArray[np.float64], camera: Camera) -> NDArray[np.float32]:
    """The rays (N, H, W, 6) of N views: origin and direction, forward of length 1."""
    across = (np.arange(camera.width) + 0.5 - camera.width / 2) / camera.focal_length
    up = (camera.height / 2 - np.arange(camera.height) - 0.5) / camera.focal_length
    rays = np.empty((len(poses), camera.height, camera.width, 6), np.float32)
    for view, (x, y, z, heading) in zip(rays, poses, strict=True):
        view[..., :3] = x, y + camera.elevation, z
        view[..., 3] = across * np.cos(heading) - np.sin(heading)
        view[..., 4] = up[:, None]
        view[..., 5] = -across * np.sin(heading) - np.cos(heading)
    return rays


def open3d_cast(home: Scene, rays: NDArray[np.float32]) -> Callable[[], object]:
    """Open3D's RaycastingScene on one thread."""
    import open3d

    raycasting = open3d.t.geometry.RaycastingScene(nthreads=1)
    tensor: Any = open3d.core.Tensor
    raycasting.add_triangles(tensor(home.vertices), tensor(home.triangles.astype(np.uint32)))
    ready = tensor(rays)
    return lambda: raycasting.cast_rays(ready, nthreads=1)


def embree_cast(home: Scene, rays: NDArray[np.float32]) -> Callable[[], object]:
    """Embree's widest packets on one thread, of blocks of pixels, on what `EmbreeRenderer` builds of a home.

    rays: from `view_rays`, of pictures that a block of 4 by 4 divides.
    """
    device = EmbreeDevice()
    lanes = device.native_packet_width()
    built = device.build(home, robust=False)
    packets = _packets(rays, lanes)
    arguments = np.zeros(16, np.uint32)
    arguments[:2] = _COHERENT, _ALL_FEATURES
    intersect = device.intersect_address(lanes)
    return lambda: _cast_all(intersect, arguments.ctypes.data, built.handle, packets)


def _packets(rays: NDArray[np.float32], lanes: int) -> NDArray[np.int32]:
    height, width = _TILE[lanes]
    views, rows, cols, _ = rays.shape
    blocks = rays.reshape(views, rows // height, height, cols // width, width, 6)
    by_field = blocks.transpose(0, 1, 3, 5, 2, 4).reshape(-1, 6, lanes)
    packets = packet_scratch(len(by_field), lanes)
    fields = packets.view(np.float32)
    fields[:, _ORIGIN : _ORIGIN + 3], fields[:, _DIRECTION : _DIRECTION + 3] = by_field[:, :3], by_field[:, 3:]
    packets[:, _MASK] = packets[:, _VALID] = -1
    return packets


@njit(cache=True, nogil=True, error_model="numpy")
def _cast_all(intersect: int, arguments: int, scene: int, packets: NDArray[np.int32]) -> None:
    fields = packets.view(np.float32)
    lanes = packets.shape[2]
    for number in range(len(packets)):
        for lane in range(lanes):
            fields[number, _FAR, lane] = np.inf
            packets[number, _GEOMETRY, lane] = -1
        address = packets[number].ctypes.data
        intersect_packet(intersect, address + _VALID * lanes * 4, scene, address, arguments)
