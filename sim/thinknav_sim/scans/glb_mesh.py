"""The mesh of a GLB file: its nodes placed, its primitives joined, its materials as colours and textures.

Cameras, lights, animations, skins and transparency are left out.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scans.glb import SPECULAR_GLOSSINESS, Glb
from thinknav_sim.scans.images import decode_image
from thinknav_sim.scans.mesh import PLAIN, Mesh, texel_colors
from thinknav_sim.scene import SceneError

_MAX_DEPTH = 64
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_glb(path: Path) -> Mesh:
    """The triangles of a GLB file's scene, in its own units and axes. Raises SceneError naming the file."""
    glb = Glb(path)
    try:
        return _SceneReader(glb).read()
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        if isinstance(error, SceneError):
            raise
        # JSON of the wrong shape shows itself in many ways; each of them is a broken file.
        raise SceneError(f"{path} is not well-formed glTF: {type(error).__name__}: {error}") from None


class _SceneReader:
    def __init__(self, glb: Glb) -> None:
        self._glb = glb
        self._images: dict[tuple[str, tuple[float, ...]], NDArray[np.uint8]] = {}

    def read(self) -> Mesh:
        document = self._glb.document
        parts: list[Mesh] = []
        if document.get("scenes"):
            roots = self._glb.entry("scenes", document.get("scene", 0)).get("nodes", [])
        else:
            children = {child for node in document.get("nodes", []) for child in node.get("children", [])}
            roots = [index for index in range(len(document.get("nodes", []))) if index not in children]
        for root in roots:
            self._add_node(root, np.eye(4), parts, 0)
        return _sharing_textures(parts)

    def _add_node(self, index: int, above: NDArray[np.float64], parts: list[Mesh], depth: int) -> None:
        if depth > _MAX_DEPTH:
            raise SceneError(f"{self._glb.path}: its nodes lie more than {_MAX_DEPTH} deep, or in a circle")
        node = self._glb.entry("nodes", index)
        placed = above @ _transform(node)
        if "mesh" in node:
            parts += [
                self._primitive(primitive, placed)
                for primitive in self._glb.entry("meshes", node["mesh"]).get("primitives", [])
                if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN)
            ]
        for child in node.get("children", []):
            self._add_node(child, placed, parts, depth + 1)

    def _primitive(self, primitive: dict[str, Any], placed: NDArray[np.float64]) -> Mesh:
        attributes = primitive["attributes"]
        local = self._glb.accessor(attributes["POSITION"]).astype(np.float64)
        if local.shape[1] != 3:
            raise SceneError(f"{self._glb.path}: positions of {local.shape[1]} coordinates")
        count = len(local)
        if "indices" in primitive:
            order = self._glb.accessor(primitive["indices"]).ravel().astype(np.int64)
            if len(order) and order.max() >= count:
                raise SceneError(f"{self._glb.path} has a triangle that names vertex {order.max()} of {count}")
        else:
            order = np.arange(count)
        triangles = _triangles(order, primitive.get("mode", _TRIANGLES))
        vertices = local @ placed[:3, :3].T + placed[:3, 3]
        material = self._glb.entry("materials", primitive["material"]) if "material" in primitive else {}
        look = _look(material)
        factor = tuple(float(value) for value in look.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)))[:3]
        slot = look.get("baseColorTexture")
        if slot is not None:
            transform = slot.get("extensions", {}).get("KHR_texture_transform", {})
            name = f"TEXCOORD_{transform.get('texCoord', slot.get('texCoord', 0))}"
            if name in attributes:
                texture = self._texture(slot["index"], factor)
                uv = _moved_uv(self._glb.accessor(attributes[name]).astype(np.float64), transform)
                return _textured(vertices, triangles, texture, self._checked_uv(uv, count))
        colors = np.tile(np.array(PLAIN if not look else _srgb(factor), np.uint8), (count, 1))
        painted = "COLOR_0" in attributes
        if painted:
            colors = self._vertex_colors(attributes["COLOR_0"], count)
        return Mesh(
            vertices,
            triangles,
            colors,
            painted,
            (),
            np.zeros((count, 2), np.float32),
            np.full(len(triangles), -1, np.int32),
        )

    def _vertex_colors(self, accessor: object, count: int) -> NDArray[np.uint8]:
        # Scanners write sRGB here, whatever the specification says of linear colours.
        given = self._glb.accessor(accessor)
        if len(given) != count or given.shape[1] < 3:
            raise SceneError(f"{self._glb.path}: {len(given)} vertex colours for {count} vertices")
        if given.dtype == np.uint8:
            return given[:, :3].astype(np.uint8)
        scale = 65535.0 if given.dtype == np.uint16 else 1.0
        values = np.nan_to_num(given[:, :3].astype(np.float64) / scale)
        colors: NDArray[np.uint8] = np.rint(np.clip(values, 0.0, 1.0) * 255).astype(np.uint8)
        return colors

    def _checked_uv(self, uv: NDArray[np.float64], count: int) -> NDArray[np.float32]:
        if uv.shape != (count, 2) or not np.isfinite(uv).all():
            raise SceneError(f"{self._glb.path} has texture coordinates that are NaN, infinite or too few")
        return uv.astype(np.float32)

    def _texture(self, index: int, factor: tuple[float, ...]) -> NDArray[np.uint8]:
        texture = self._glb.entry("textures", index)
        extensions = texture.get("extensions", {})
        source = texture.get("source")
        for extension in ("EXT_texture_webp", "KHR_texture_basisu"):
            source = extensions.get(extension, {}).get("source", source)
        image = self._glb.entry("images", source)
        key = (str(source), factor)
        if key not in self._images:
            data = self._glb.resource(image["uri"]) if "uri" in image else self._glb.view(image.get("bufferView"))
            pixels = decode_image(data, f"{self._glb.path}: image {source}")
            if any(value != 1.0 for value in factor):
                pixels = np.clip(pixels * (np.array(_srgb(factor)) / 255.0), 0, 255).astype(np.uint8)
            self._images[key] = pixels
        return self._images[key]


def _look(material: dict[str, Any]) -> dict[str, Any]:
    """A material's colour and texture by the keys of pbrMetallicRoughness, whichever of the two ways they are given."""
    look: dict[str, Any] = material.get("pbrMetallicRoughness", {})
    glossy = material.get("extensions", {}).get(SPECULAR_GLOSSINESS)
    if glossy is None or "baseColorTexture" in look:
        return look
    keys = {"diffuseFactor": "baseColorFactor", "diffuseTexture": "baseColorTexture"}
    return {**look, **{keys[key]: value for key, value in glossy.items() if key in keys}}


def _transform(node: dict[str, Any]) -> NDArray[np.float64]:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    placed = np.eye(4)
    x, y, z, w = (float(value) for value in node.get("rotation", (0, 0, 0, 1)))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    placed[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), np.float64)
    placed[:3, 3] = node.get("translation", (0, 0, 0))
    return placed


def _triangles(order: NDArray[np.int64], mode: int) -> NDArray[np.int32]:
    if mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3).astype(np.int32)
    first = order[:-2] if mode == _STRIP else np.repeat(order[:1], max(len(order) - 2, 0))
    return np.stack([first, order[1:-1], order[2:]], axis=1).astype(np.int32)


def _srgb(factor: tuple[float, ...]) -> tuple[int, ...]:
    """A linear colour as sRGB bytes."""
    linear = np.clip(np.array(factor), 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return tuple(round(float(value) * 255) for value in encoded)


def _moved_uv(uv: NDArray[np.float64], transform: dict[str, Any]) -> NDArray[np.float64]:
    """KHR_texture_transform."""
    angle = float(transform.get("rotation", 0.0))
    scaled = uv * np.array(transform.get("scale", (1.0, 1.0)), np.float64)
    turned = np.stack(
        [
            np.cos(angle) * scaled[:, 0] + np.sin(angle) * scaled[:, 1],
            -np.sin(angle) * scaled[:, 0] + np.cos(angle) * scaled[:, 1],
        ],
        axis=1,
    )
    return turned + np.array(transform.get("offset", (0.0, 0.0)), np.float64)


def _textured(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], texture: NDArray[np.uint8], uv: NDArray[np.float32]
) -> Mesh:
    return Mesh(
        vertices, triangles, texel_colors(texture, uv), True, (texture,), uv, np.zeros(len(triangles), np.int32)
    )


def _sharing_textures(parts: list[Mesh]) -> Mesh:
    """All parts in one, an image that several use held once."""
    joined = Mesh.joined(parts)
    unique: dict[int, int] = {}
    kept: list[NDArray[np.uint8]] = []
    for texture in joined.textures:
        if id(texture) not in unique:
            unique[id(texture)] = len(kept)
            kept.append(texture)
    renumbered = np.array([*(unique[id(texture)] for texture in joined.textures), -1], np.int32)
    return Mesh(
        joined.vertices,
        joined.triangles,
        joined.colors,
        joined.painted,
        tuple(kept),
        joined.uv,
        renumbered[joined.triangle_textures],
    )
