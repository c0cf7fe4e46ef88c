"""Which files a path stands for: a mesh, and what tells its objects apart.

Of what is in them it knows which other files they name.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from thinknav_sim.scans.references import named_files
from thinknav_sim.scene import SceneError
from thinknav_sim.scene_files import scene_name_of

FORMATS = (".glb", ".obj", ".ply")
_BASIS = ".basis.glb"
_HINTS = {
    ".dae": "COLLADA loses triangles without a word; export it as GLB",
    ".gltf": "pack it into one file, GLB",
    ".fbx": "export it as GLB",
    ".usdz": "export it as GLB",
    ".basis": "give the .basis.glb beside it",
}


@dataclass(frozen=True)
class Source:
    """The files of one scan.

    mesh: GLB, OBJ or PLY. semantic_glb: HM3D's painted mesh. room_capture: a JSON of boxes. is_hm3d: by its name.
    """

    name: str
    mesh: Path
    semantic_glb: Path | None
    room_capture: Path | None
    is_hm3d: bool

    def digest(self, options: str) -> str:
        """A hash of everything that an import depends on: the contents of the files, and the options."""
        total = hashlib.blake2b(f"{self.name} {options}".encode(), digest_size=16)
        files = [self.mesh]
        if self.semantic_glb is not None:
            files += [self.semantic_glb, self.semantic_glb.with_suffix(".txt")]
        if self.room_capture is not None:
            files.append(self.room_capture)
        for path in files:
            _add(total, path)
        for path in named_files(self.mesh):
            if path.is_file():
                _add(total, path)
            else:
                total.update(f"no {path.name} ".encode())
        return total.hexdigest()


def _add(total: "hashlib.blake2b", path: Path) -> None:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}") from None
    total.update(f"{path.name} {len(data)} ".encode())
    total.update(data)


def find_source(path: Path, semantics: Path | None = None) -> Source:
    """The scan at a path: a mesh file, or a folder as HM3D has one for each scene.

    Beside X.basis.glb lie X.semantic.glb and X.semantic.txt, beside X.glb may lie X.json (a room capture); semantics
    names another one. Raises SceneError.
    """
    if not path.exists():
        raise SceneError(f"{path} does not exist")
    mesh = _mesh_in(path) if path.is_dir() else path
    if mesh.suffix.lower() not in FORMATS:
        hint = _HINTS.get(mesh.suffix.lower(), "export it as GLB")
        raise SceneError(f"{mesh} is not GLB, OBJ or PLY; {hint}")
    is_hm3d = mesh.name.lower().endswith(_BASIS)
    name = scene_name_of(mesh.name)
    semantic_glb = mesh.with_name(f"{name}.semantic.glb") if is_hm3d else None
    capture = mesh.with_suffix(".json")
    if semantics is not None:
        if not semantics.is_file():
            raise SceneError(f"{semantics} does not exist")
        is_painted = semantics.name.lower().endswith(".glb")
        semantic_glb, capture = (semantics, capture) if is_painted else (None, semantics)
    if semantic_glb is not None and not semantic_glb.exists():
        semantic_glb = None
    return Source(
        name=name,
        mesh=mesh,
        semantic_glb=semantic_glb,
        room_capture=capture if semantic_glb is None and capture.is_file() else None,
        is_hm3d=is_hm3d,
    )


def _mesh_in(folder: Path) -> Path:
    here = sorted(folder.iterdir())
    meshes = [path for path in here if path.name.lower().endswith(_BASIS)]
    meshes = meshes or [
        path for path in here if path.suffix.lower() in FORMATS and not path.name.lower().endswith(".semantic.glb")
    ]
    if len(meshes) == 1:
        return meshes[0]
    if meshes:
        raise SceneError(f"{folder} holds {len(meshes)} scans; give one of them, such as {meshes[0]}")
    inner = next((path for path in here if path.is_dir() and any(path.glob("*.glb"))), None)
    hint = f"; give one of the folders in it, such as {inner}" if inner is not None else ""
    raise SceneError(f"{folder} holds no GLB, OBJ or PLY{hint}")
