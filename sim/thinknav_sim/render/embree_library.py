"""Intel Embree 4 through ctypes: finding the shared library, its C functions, devices and built scenes.

The library is the one inside the `embreex` wheel, whose file name carries a hash; it is found through the
package's list of files, and `embreex` itself is never imported. Names and numbers are those of Embree's
headers (https://github.com/RenderKit/embree, include/embree4). Knows nothing of cameras, colours or numba.
"""

import ctypes
import functools
import importlib.metadata
import re
import weakref
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render.renderer import RendererUnavailable
from thinknav_sim.scene import Scene

PACKAGE = "embreex"
_FILE_NAME = re.compile(r"(lib)?embree4.*\.(so|dylib|dll)")

# RTCDeviceProperty
_VERSION = 0
_NATIVE_PACKET_PROPERTIES = {16: 34, 8: 33, 4: 32}
# RTCBufferType and RTCFormat
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1
_UINT3, _FLOAT3 = 0x5003, 0x9003
_TRIANGLE_GEOMETRY = 0
_SCENE_FLAG_ROBUST = 1 << 2
# RTCBuildQuality. The high one splits triangles: a tenth off the time of a picture for some 25 ms of building a home,
# which a scan of hundreds of thousands of triangles would pay in seconds and hundreds of megabytes.
_QUALITY_MEDIUM, _QUALITY_HIGH = 1, 2
_MAX_HIGH_QUALITY_TRIANGLES = 100_000
_ERRORS = {
    2: "invalid argument",
    3: "invalid operation",
    4: "out of memory",
    5: "unsupported CPU",
    6: "cancelled",
}

PACKET_WIDTHS = tuple(_NATIVE_PACKET_PROPERTIES)

_handle, _uint, _int, _size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_size_t
_FUNCTIONS: dict[str, tuple[type | None, tuple[type, ...]]] = {
    "rtcNewDevice": (_handle, (ctypes.c_char_p,)),
    "rtcReleaseDevice": (None, (_handle,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_handle, _int)),
    "rtcGetDeviceError": (_int, (_handle,)),
    "rtcNewScene": (_handle, (_handle,)),
    "rtcSetSceneFlags": (None, (_handle, _int)),
    "rtcSetSceneBuildQuality": (None, (_handle, _int)),
    "rtcAttachGeometry": (_uint, (_handle, _handle)),
    "rtcCommitScene": (None, (_handle,)),
    "rtcReleaseScene": (None, (_handle,)),
    "rtcNewGeometry": (_handle, (_handle, _int)),
    "rtcSetSharedGeometryBuffer": (None, (_handle, _int, _uint, _int, _handle, _size, _size, _size)),
    "rtcCommitGeometry": (None, (_handle,)),
    "rtcReleaseGeometry": (None, (_handle,)),
}


def find_library() -> Path:
    """The path of Embree's shared library. Raises RendererUnavailable when there is none."""
    try:
        files = importlib.metadata.files(PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        raise RendererUnavailable(f"the package {PACKAGE} is not installed: pip install {PACKAGE}") from None
    for file in files or ():
        if _FILE_NAME.match(file.name):
            return Path(str(file.locate()))
    raise RendererUnavailable(f"the package {PACKAGE} has no Embree 4 library among its files; reinstall it")


@functools.cache
def bind_library(path: Path) -> ctypes.CDLL:
    """Load the library and declare the functions used here. Raises RendererUnavailable when that fails."""
    try:
        library = ctypes.CDLL(str(path))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise RendererUnavailable(f"{path.name} could not be bound: {error}") from error
    return library


class EmbreeDevice:
    """An Embree device: where scenes are built. Freed by `close`, or with its last reference."""

    def __init__(self) -> None:
        self._library = bind_library(find_library())
        self._handle: int = self._library.rtcNewDevice(None) or 0
        if not self._handle:
            raise RendererUnavailable(f"Embree refuses this machine: {self._last_error(0)}")
        self._release = weakref.finalize(self, self._library.rtcReleaseDevice, self._handle)
        version = self._property(_VERSION)
        if version // 10_000 != 4:
            raise RendererUnavailable(f"Embree 4 is needed, and {PACKAGE} holds version number {version}")

    def native_packet_width(self) -> int:
        """The most rays that this CPU intersects at once: 16 with AVX-512, 8 with AVX2, else 4."""
        for width, device_property in _NATIVE_PACKET_PROPERTIES.items():
            if self._property(device_property):
                return width
        raise RendererUnavailable("this build of Embree has no ray packets")

    def intersect_address(self, packet_width: int) -> int:
        """The address of rtcIntersect4, 8 or 16, for compiled code to call."""
        function = getattr(self._library, f"rtcIntersect{packet_width}")
        return ctypes.cast(function, ctypes.c_void_p).value or 0

    def build(self, scene: Scene, robust: bool) -> "EmbreeScene":
        """The acceleration structure of a scene's triangles.

        robust: no ray slips through the edge that two triangles share. Otherwise a ray aimed at the very edge
        may; looking for it costs half as much time again.
        Raises RuntimeError when Embree fails, or the device is closed.
        """
        self.check_open()
        # Embree reads 16 bytes at each vertex of 12, so the last one needs something behind it.
        vertices = np.ascontiguousarray(np.concatenate([scene.vertices, np.zeros((1, 3), np.float32)]))
        triangles = np.array(scene.triangles, np.uint32, order="C")
        library = self._library
        handle = library.rtcNewScene(self._handle)
        library.rtcSetSceneFlags(handle, _SCENE_FLAG_ROBUST if robust else 0)
        fine = not robust and len(triangles) <= _MAX_HIGH_QUALITY_TRIANGLES
        library.rtcSetSceneBuildQuality(handle, _QUALITY_HIGH if fine else _QUALITY_MEDIUM)
        geometry = library.rtcNewGeometry(self._handle, _TRIANGLE_GEOMETRY)
        for kind, layout, buffer, count in (
            (_VERTEX_BUFFER, _FLOAT3, vertices, len(scene.vertices)),
            (_INDEX_BUFFER, _UINT3, triangles, len(triangles)),
        ):
            library.rtcSetSharedGeometryBuffer(geometry, kind, 0, layout, buffer.ctypes.data, 0, 12, count)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(handle, geometry)
        library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(handle)
        built = EmbreeScene(library, handle, (vertices, triangles))
        if error := self._last_error(self._handle):
            raise RuntimeError(f"Embree could not build the scene {scene.name!r}: {error}")
        return built

    def check_open(self) -> None:
        """Raises RuntimeError when the device is closed."""
        if not self._release.alive:
            raise RuntimeError("the renderer is closed")

    def close(self) -> None:
        """Free the device; scenes that it built stay valid for as long as they are held."""
        self._release()

    def _property(self, device_property: int) -> int:
        return int(self._library.rtcGetDeviceProperty(self._handle, device_property))

    def _last_error(self, handle: int) -> str:
        code = int(self._library.rtcGetDeviceError(handle))
        return _ERRORS.get(code, f"error {code}") if code else ""


class EmbreeScene:
    """A built scene, freed with its last reference. Embree reads the buffers in place; they live as long."""

    def __init__(self, library: ctypes.CDLL, handle: int, buffers: tuple[NDArray[np.generic], ...]) -> None:
        self.handle = handle
        self._buffers = buffers
        self._release = weakref.finalize(self, library.rtcReleaseScene, handle)
