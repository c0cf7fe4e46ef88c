"""The container of a GLB file (glTF 2.0, binary): its JSON and the arrays it describes, checked against what is there.

Every length is compared with the bytes that the file holds before anything is read or allocated. Knows nothing of what
the arrays mean; `glb_mesh` does. Format: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scene import SceneError

_DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_UNREADABLE = {
    "EXT_meshopt_compression": "its geometry is compressed with meshopt (EXT_meshopt_compression)",
    "KHR_meshopt_compression": "its geometry is compressed with meshopt (KHR_meshopt_compression)",
    "KHR_draco_mesh_compression": "its geometry is compressed with Draco (KHR_draco_mesh_compression)",
}
# An older way to give a material its colour and texture.
SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_READABLE = {
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "KHR_materials_unlit",
    SPECULAR_GLOSSINESS,
}


class Glb:
    """One file's JSON (`document`) and its arrays.

    Raises SceneError, naming the file, for whatever does not hold together.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        data = path.read_bytes()
        if len(data) < 20 or data[:4] != b"glTF":
            raise SceneError(f"{path} is not a GLB file: it does not begin with 'glTF'")
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise SceneError(f"{path} is glTF {version}; only version 2 is read")
        if length > len(data):
            raise SceneError(f"{path} is truncated: it says it has {length} bytes, and has {len(data)}")
        chunks = self._chunks(data, length)
        self.document = self._parse(chunks[0])
        self._binary = chunks[1] if len(chunks) > 1 else b""
        self._refuse_extensions()
        self._buffers: dict[int, bytes] = {}

    def _chunks(self, data: bytes, length: int) -> list[bytes]:
        chunks, offset = [], 12
        while offset + 8 <= length:
            size, kind = struct.unpack_from("<II", data, offset)
            offset += 8
            if offset + size > length:
                raise SceneError(
                    f"{self.path} is truncated: a chunk of {size} bytes begins {length - offset} before its end"
                )
            if kind in (0x4E4F534A, 0x004E4942):  # "JSON", "BIN"
                chunks.append(data[offset : offset + size])
            offset += size
        if not chunks:
            raise SceneError(f"{self.path} holds no glTF: its JSON chunk is missing")
        return chunks

    def _parse(self, chunk: bytes) -> dict[str, Any]:
        try:
            document = json.loads(chunk)
        except (ValueError, RecursionError) as error:
            raise SceneError(f"{self.path}: its JSON chunk cannot be read: {error}") from None
        if not isinstance(document, dict):
            raise SceneError(f"{self.path}: its JSON chunk is not an object")
        return document

    def _refuse_extensions(self) -> None:
        required, used = self._names("extensionsRequired"), self._names("extensionsUsed")
        for name in (*required, *used):
            if name in _UNREADABLE:
                raise SceneError(
                    f"{self.path}: {_UNREADABLE[name]}, which is not read; export it without compression "
                    "(for example: npx @gltf-transform/cli copy IN.glb OUT.glb)"
                )
        unknown = sorted(set(required) - _READABLE)
        if unknown:
            raise SceneError(f"{self.path} requires glTF extensions that are not read: {', '.join(unknown)}")

    def _names(self, key: str) -> list[str]:
        names = self.document.get(key, [])
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise SceneError(f"{self.path}: {key} is no list of names")
        return names

    def entry(self, kind: str, index: object) -> dict[str, Any]:
        """One element of a list of the document, such as ("meshes", 0)."""
        entries = self.document.get(kind, [])
        if not isinstance(index, int) or not isinstance(entries, list) or not 0 <= index < len(entries):
            raise SceneError(f"{self.path} names {kind}[{index}], which it does not hold")
        if not isinstance(entries[index], dict):
            raise SceneError(f"{self.path}: {kind}[{index}] is not an object")
        found: dict[str, Any] = entries[index]
        return found

    def view(self, index: object) -> bytes:
        """The bytes of a buffer view."""
        view = self.entry("bufferViews", index)
        buffer = self._buffer(view.get("buffer"))
        offset, length = self._count(view, "byteOffset", 0), self._count(view, "byteLength")
        if offset + length > len(buffer):
            raise SceneError(
                f"{self.path}: bufferViews[{index}] ends at byte {offset + length} of a buffer that holds {len(buffer)}"
            )
        return buffer[offset : offset + length]

    def accessor(self, index: object) -> NDArray[Any]:
        """The array (count, width) of an accessor; normalised integers as float32 in 0..1 or -1..1."""
        entry = self.entry("accessors", index)
        if "sparse" in entry or "bufferView" not in entry:
            raise SceneError(f"{self.path}: accessors[{index}] is sparse, which is not read; export it again")
        dtype, width = _DTYPES.get(entry.get("componentType", 0)), _WIDTHS.get(entry.get("type", ""))
        if dtype is None or width is None:
            raise SceneError(f"{self.path}: accessors[{index}] is of a type that is not read")
        data, count = self.view(entry["bufferView"]), self._count(entry, "count")
        size = np.dtype(dtype).itemsize * width
        stride = self._count(self.entry("bufferViews", entry["bufferView"]), "byteStride", size)
        offset = self._count(entry, "byteOffset", 0)
        if stride < size or (count and offset + (count - 1) * stride + size > len(data)):
            raise SceneError(
                f"{self.path}: accessors[{index}] claims {count} elements of {size} bytes, "
                f"more than the {len(data)} bytes that are there"
            )
        values = np.ndarray(
            (count, width), np.dtype(dtype).newbyteorder("<"), data, offset, (stride, np.dtype(dtype).itemsize)
        )
        if entry.get("normalized") and dtype is not np.float32:
            scaled: NDArray[Any] = np.maximum(values.astype(np.float32) / float(np.iinfo(values.dtype).max), -1.0)
            return scaled
        return values.astype(dtype)

    def resource(self, uri: str) -> bytes:
        """What a data URI holds, or a file beside this one."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (ValueError, binascii.Error):
                raise SceneError(f"{self.path} holds a data URI that is not base64") from None
        file = self.path.parent / unquote(uri)
        try:
            return file.read_bytes()
        except OSError as error:
            raise SceneError(f"{self.path} needs {file}, which cannot be read: {error.strerror}") from None

    def _buffer(self, index: object) -> bytes:
        entry = self.entry("buffers", index)
        uri = entry.get("uri")
        if uri is None:
            return self._binary
        assert isinstance(index, int)
        if index not in self._buffers:
            self._buffers[index] = self.resource(str(uri))
        return self._buffers[index]

    def _count(self, entry: dict[str, Any], key: str, default: int | None = None) -> int:
        value = entry.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise SceneError(f"{self.path}: a {key} is {value!r}, not a whole number")
        return value
