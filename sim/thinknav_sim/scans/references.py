"""Which other files a mesh file names: buffers, images, material libraries and their textures.

Reads as much of a file as that takes. What is named need not be there.
"""

import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from thinknav_sim.scans.glb import Glb

# The most bytes of a PLY file that its header may take.
PLY_HEADER = 1 << 16
_LIBRARY = re.compile(rb"^\s*mtllib\s+(.+?)\s*$", re.MULTILINE)
_PLY_TEXTURE = re.compile(rb"^comment TextureFile\s+(.+?)\s*$", re.MULTILINE)


def named_files(mesh: Path) -> list[Path]:
    """The files that an import of a GLB, OBJ or PLY reads besides it, in order. Raises SceneError for a broken GLB."""
    kind = mesh.suffix.lower()
    if kind == ".glb":
        document = Glb(mesh).document
        uris = [_uri(entry) for part in ("buffers", "images") for entry in _entries(document, part)]
        return sorted({mesh.parent / unquote(uri) for uri in uris if uri and not uri.startswith("data:")})
    if kind == ".ply":
        with mesh.open("rb") as file:
            head = file.read(PLY_HEADER).partition(b"end_header")[0]
        return sorted(mesh.parent / _text(name) for name in _PLY_TEXTURE.findall(head))
    libraries = material_libraries(mesh)
    textures = {library.parent / name for library in libraries for name in material_textures(library).values()}
    return [*libraries, *sorted(textures)]


def material_libraries(obj: Path) -> list[Path]:
    """The MTL files that an OBJ names."""
    return sorted({obj.parent / _text(name) for name in _LIBRARY.findall(obj.read_bytes())})


def material_textures(library: Path) -> dict[str, str]:
    """The colour texture (`map_Kd`) that each material of an MTL file names; nothing of a file that is not there."""
    textures: dict[str, str] = {}
    material = ""
    for line in _text(library.read_bytes()).splitlines() if library.is_file() else ():
        key, _, value = line.strip().partition(" ")
        if key.lower() == "newmtl":
            material = " ".join(value.split())
        elif key.lower() == "map_kd":
            textures[material] = value.strip()
    return textures


def _entries(document: dict[str, Any], part: str) -> list[Any]:
    entries = document.get(part)
    return entries if isinstance(entries, list) else []


def _uri(entry: object) -> str | None:
    uri = entry.get("uri") if isinstance(entry, dict) else None
    return uri if isinstance(uri, str) else None


def _text(name: bytes) -> str:
    return name.decode("utf-8", errors="replace")
