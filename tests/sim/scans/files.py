"""Small scans made by hand: a furnished room, and writers of GLB, OBJ and PLY that need no library."""

import io
import json
import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

BOX_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    np.int32,
)  # fmt: skip
ROOM = (0.0, 0.0, 0.0, 5.0, 2.5, 4.0)
SOFA = (0.5, 0.0, 0.3, 2.3, 0.8, 1.1)

Boxes = Sequence[tuple[float, ...]]
Geometry = tuple[NDArray[np.float32], NDArray[np.int32]]


def boxes(corners: Boxes = (ROOM, SOFA)) -> Geometry:
    """Boxes (low x, y, z, high x, y, z) as one mesh."""
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    vertices = [np.where(bits, box[3:], box[:3]) for box in corners]
    triangles = [BOX_TRIANGLES + 8 * i for i in range(len(corners))]
    return np.concatenate(vertices).astype(np.float32), np.concatenate(triangles).astype(np.int32)


def png(pixels: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def glb_bytes(
    vertices: NDArray[np.float32],
    triangles: NDArray[np.int32],
    colors: NDArray[np.uint8] | None = None,
    uv: NDArray[np.float32] | None = None,
    image: bytes | None = None,
    change: Callable[[dict[str, Any]], None] = lambda document: None,
) -> bytes:
    """A GLB of one mesh. A KTX2 image is named as KHR_texture_basisu does. change: a last hand on the JSON."""
    binary, views, accessors = b"", [], []

    def put(data: bytes) -> int:
        nonlocal binary
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        binary += data + b"\0" * (-len(data) % 4)
        return len(views) - 1

    def array(values: NDArray[Any], component: int, kind: str, **more: Any) -> int:
        view = put(values.tobytes())
        accessors.append({"bufferView": view, "componentType": component, "type": kind, "count": len(values), **more})
        return len(accessors) - 1

    attributes = {"POSITION": array(vertices.astype(np.float32), 5126, "VEC3")}
    primitive: dict[str, Any] = {"attributes": attributes}
    primitive["indices"] = array(triangles.ravel().astype(np.uint32), 5125, "SCALAR")
    if colors is not None:
        padded = np.concatenate([colors, np.full((len(colors), 1), 255, np.uint8)], axis=1)
        attributes["COLOR_0"] = array(padded, 5121, "VEC4", normalized=True)
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
    }
    if uv is not None and image is not None:
        attributes["TEXCOORD_0"] = array(uv.astype(np.float32), 5126, "VEC2")
        document["images"] = [{"bufferView": put(image), "mimeType": "image/png"}]
        document["textures"] = [{"source": 0}]
        if image.startswith(b"\xabKTX"):
            document["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
            document["extensionsRequired"] = ["KHR_texture_basisu"]
        document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        primitive["material"] = 0
    document["buffers"] = [{"byteLength": len(binary)}]
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def obj_text(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> str:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices]
    return "\n".join(lines + ["f " + " ".join(str(i + 1) for i in triangle) for triangle in triangles]) + "\n"


def ply_bytes(vertices: NDArray[np.float32], triangles: NDArray[np.int32], colors: NDArray[np.uint8]) -> bytes:
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    points = np.zeros(len(vertices), [("p", "<f4", 3), ("c", "u1", 3)])
    points["p"], points["c"] = vertices, colors
    faces = np.zeros(len(triangles), [("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, triangles
    return header.encode() + points.tobytes() + faces.tobytes()


def textured_ply_text(vertices: NDArray[np.float32], triangles: NDArray[np.int32], comment: str) -> str:
    """A PLY with one place on a texture for all vertices; the comment names the texture."""
    values = "".join(f"property float {name}\n" for name in "xyzst")
    head = f"ply\nformat ascii 1.0\n{comment}\nelement vertex {len(vertices)}\n{values}element face {len(triangles)}\n"
    body = [f"{x} {y} {z} 0.5 0.5" for x, y, z in vertices] + [f"3 {a} {b} {c}" for a, b, c in triangles]
    return f"{head}property list uchar int vertex_indices\nend_header\n" + "\n".join(body) + "\n"


def capture_text(label: str, box: tuple[float, ...]) -> str:
    """A room capture with one box, upright: its z axis points up in the world."""
    half = float(np.sqrt(0.5))
    x0, y0, z0, x1, y1, z1 = box
    return json.dumps(
        {
            "spatialEntities": [
                {
                    "semanticLabel_META": label,
                    "locatable_META": {
                        "orientation": {"x": -half, "y": 0, "z": 0, "w": half},
                        "position": {"x": (x0 + x1) / 2, "y": y1, "z": (z0 + z1) / 2},
                    },
                    "bounded3D_META": {
                        "offset": {"x": -(x1 - x0) / 2, "y": -(z1 - z0) / 2, "z": y0 - y1},
                        "extent": {"width": x1 - x0, "height": z1 - z0, "depth": y1 - y0},
                    },
                },
                {"semanticLabel_META": "WALL_FACE", "locatable_META": {}, "bounded2D_META": {"offset": {}}},
            ]
        }
    )
