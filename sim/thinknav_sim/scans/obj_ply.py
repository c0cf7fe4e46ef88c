"""The mesh of an OBJ or PLY file, through trimesh.

Knows nothing of GLB, which is read without it.
"""

import logging
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scans.images import decode_image
from thinknav_sim.scans.mesh import PLAIN, Mesh, texel_colors
from thinknav_sim.scans.references import PLY_HEADER, material_libraries, material_textures, named_files
from thinknav_sim.scene import SceneError

# A PLY has one texture at most, and no names of materials.
_PLY_MATERIAL = ""


def read_obj_or_ply(path: Path) -> Mesh:
    """The triangles of an OBJ or PLY file, in its own units and axes. Raises SceneError naming the file."""
    try:
        import trimesh
    except ImportError:
        raise SceneError(f"reading {path} needs trimesh; install 'thinknav[scans]'") from None
    is_ply = path.suffix.lower() == ".ply"
    if is_ply:
        _check_ply(path)
    textures = _textures(path)
    # It warns of materials that it does not find; the mesh is good without them.
    logging.getLogger("trimesh").setLevel(logging.ERROR)
    try:
        loaded = trimesh.load_scene(path, process=False, maintain_order=True)
        # Neither format has transforms: what is in the file lies where it is.
        parts = [
            _part(geometry, path, textures)
            for geometry in loaded.geometry.values()
            if isinstance(geometry, trimesh.Trimesh)
        ]
    except SceneError:
        raise
    except Exception as error:  # its readers raise whatever they stumble on
        raise SceneError(f"{path} cannot be read: {type(error).__name__}: {error}") from None
    mesh = Mesh.joined([part for part in parts if len(part.triangles)])
    if not is_ply:
        _check_obj(path, len(mesh.triangles))
    return mesh


def _textures(path: Path) -> dict[str, Path]:
    """The texture of each material that has one."""
    if path.suffix.lower() == ".ply":
        return dict(zip([_PLY_MATERIAL], named_files(path), strict=False))
    libraries = material_libraries(path)
    return {name: library.parent / file for library in libraries for name, file in material_textures(library).items()}


def _part(geometry: Any, path: Path, textures: dict[str, Path]) -> Mesh:
    """textures: by the names of materials, for those that must not be missing."""
    vertices = np.asarray(geometry.vertices, np.float64)
    triangles = np.asarray(geometry.faces).reshape(-1, 3).astype(np.int32)
    if vertices.shape[1:] != (3,):
        raise SceneError(f"{path} has vertices of {vertices.shape[-1]} coordinates, not 3")
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        raise SceneError(f"{path} has a triangle that names vertex {triangles.max()} of {len(vertices)}")
    visual = geometry.visual
    uv = getattr(visual, "uv", None)
    material = getattr(visual, "material", None)
    image = getattr(material, "image", None)
    is_ply = path.suffix.lower() == ".ply"
    texture_file = textures.get(_PLY_MATERIAL if is_ply else getattr(material, "name", None) or "")
    if is_ply and not _shows(texture_file):
        image = None  # trimesh has put a picture of its own there
    if uv is not None and image is None and texture_file is not None:
        missing = "cannot be decoded" if texture_file.is_file() else "is not there"
        raise SceneError(f"{path} needs the texture {texture_file}, which {missing}")
    if uv is not None and image is not None and len(uv) == len(vertices):
        # These formats measure v upwards.
        down = np.stack([np.asarray(uv)[:, 0], 1.0 - np.asarray(uv)[:, 1]], axis=1).astype(np.float32)
        if not np.isfinite(down).all():
            raise SceneError(f"{path} has texture coordinates that are NaN or infinite")
        texture = np.asarray(image.convert("RGB"))
        return Mesh(
            vertices, triangles, texel_colors(texture, down), True, (texture,), down, np.zeros(len(triangles), np.int32)
        )
    colors, painted = _colors(visual, len(vertices))
    return Mesh(
        vertices,
        triangles,
        colors,
        painted,
        (),
        np.zeros((len(vertices), 2), np.float32),
        np.full(len(triangles), -1, np.int32),
    )


def _shows(texture_file: Path | None) -> bool:
    """Whether a picture is there and can be decoded."""
    try:
        return texture_file is not None and decode_image(texture_file.read_bytes(), texture_file).size > 0
    except (OSError, SceneError):
        return False


def _colors(visual: Any, count: int) -> tuple[NDArray[np.uint8], bool]:
    if getattr(visual, "kind", None) in ("vertex", "face"):
        given = np.asarray(visual.vertex_colors)
        if given.shape[0] == count:
            return given[:, :3].astype(np.uint8), True
    diffuse = getattr(getattr(visual, "material", None), "diffuse", None)
    one = np.asarray(PLAIN if diffuse is None else diffuse)[:3]
    return np.tile(one.astype(np.uint8), (count, 1)), False


def _check_ply(path: Path) -> None:
    """A binary PLY says how many vertices of what size it holds; a truncated one would be read as noise."""
    with path.open("rb") as file:
        head = file.read(PLY_HEADER)
    end = head.find(b"end_header")
    if not head.startswith(b"ply") or end < 0:
        raise SceneError(f"{path} is not a PLY file: its header is missing or has no end")
    sizes = {b"char": 1, b"uchar": 1, b"int8": 1, b"uint8": 1, b"short": 2, b"ushort": 2, b"int16": 2, b"uint16": 2}
    sizes |= {b"double": 8, b"float64": 8, b"int64": 8, b"uint64": 8}
    text = b"format ascii" in head[:end]
    least = count = 0
    for line in head[:end].splitlines():
        words = line.split()
        if len(words) == 3 and words[0] == b"element" and words[2].isdigit():
            count = int(words[2])
        elif len(words) >= 3 and words[0] == b"property":
            # In text a digit and a space for each value.
            least += count * (2 if text else _property_size(words, sizes))
    size = path.stat().st_size - end - len(b"end_header")
    if size < least:
        raise SceneError(
            f"{path} is truncated: its header promises at least {least} bytes of data, and {size} are there"
        )


def _property_size(words: list[bytes], sizes: dict[bytes, int]) -> int:
    """The least bytes of one value; of a list its length, and three indices where it is a face."""
    if words[1] != b"list":
        return sizes.get(words[1], 4)
    corners = 3 if words[-1].startswith(b"vertex_ind") else 0
    return sizes.get(words[2], 4) + corners * (sizes.get(words[3], 4) if len(words) > 3 else 0)


def _check_obj(path: Path, read: int) -> None:
    """Every face of the file must have come through."""
    wanted = 0
    with path.open("rb") as file:
        for line in file:
            if line.startswith((b"f ", b"f\t")):
                wanted += max(len(line.split()) - 3, 0)
    if read < wanted:
        raise SceneError(f"{path} has {wanted} triangles, of which only {read} could be read; are its faces complete?")
