"""An imported scene in one file of plain arrays (.npz), written whole or not at all.

Serves as the cache of imports and as what `thinknav scenes import` leaves behind. Holds no pickles.
"""

import json
import os
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from thinknav_sim.scene import Box, ObjectInstance, Scene, SceneError

# Raised whenever what an import makes of the same file changes, so that no old result is used.
FORMAT = 2


def cache_folder() -> Path:
    """Where imports are kept: $THINKNAV_CACHE, or thinknav/scenes in the user's cache folder."""
    given = os.environ.get("THINKNAV_CACHE")
    if given:
        return Path(given)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "thinknav" / "scenes"


def write_scene(path: Path, scene: Scene, notes: tuple[str, ...]) -> None:
    """Write a scene and what is to be said about it. Raises OSError where the folder cannot be written."""
    header = {
        "format": FORMAT,
        "name": scene.name,
        "floors": scene.floors,
        "level_floors": scene.level_floors,
        "notes": notes,
        "objects": [
            [instance.category, instance.box.low.tolist(), instance.box.high.tolist()] for instance in scene.objects
        ],
        "textures": len(scene.textures),
    }
    arrays: dict[str, Any] = {
        "header": np.frombuffer(json.dumps(header).encode(), np.uint8),
        "vertices": scene.vertices,
        "triangles": scene.triangles,
        "colors": scene.colors,
        "triangle_objects": scene.triangle_objects,
    }
    if scene.uv is not None and scene.triangle_textures is not None:
        arrays |= {"uv": scene.uv, "triangle_textures": scene.triangle_textures}
    arrays |= {f"texture_{index}": texture for index, texture in enumerate(scene.textures)}
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read_scene(path: Path) -> tuple[Scene, tuple[str, ...]]:
    """A scene and its notes. Raises SceneError for a file that is not one of these, or is of another version."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            header = json.loads(arrays["header"].tobytes())
            if header["format"] != FORMAT:
                raise SceneError(f"{path} is of format {header['format']}, not {FORMAT}; import the scan again")
            if not header["floors"]:
                raise SceneError(f"{path} has no floor that one could stand on")
            scene = Scene(
                name=header["name"],
                vertices=arrays["vertices"],
                triangles=arrays["triangles"],
                colors=arrays["colors"],
                triangle_objects=arrays["triangle_objects"],
                objects=tuple(
                    ObjectInstance(index, category, Box(np.array(low), np.array(high)))
                    for index, (category, low, high) in enumerate(header["objects"])
                ),
                floors=tuple(header["floors"]),
                level_floors=header["level_floors"],
                textures=tuple(arrays[f"texture_{index}"] for index in range(header["textures"])),
                uv=arrays.get("uv"),
                triangle_textures=arrays.get("triangle_textures"),
            )
            return scene, tuple(header["notes"])
    except SceneError:
        raise
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        NotImplementedError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise SceneError(f"{path} is not an imported scene: {error}") from None
