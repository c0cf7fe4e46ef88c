"""Files that make no scene: one clear error that names the file and the cause, never a crash or an empty world."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.sim.scans.conftest import WriteGlb
from tests.sim.scans.files import ROOM, boxes, glb_bytes, obj_text, ply_bytes, png
from thinknav_sim.scans import ScanOptions, load_scan
from thinknav_sim.scans.glb_mesh import read_glb
from thinknav_sim.scene import SceneError

Change = Callable[[dict[str, Any]], None]


def setting(*keys: Any, to: Any) -> Change:
    def change(document: dict[str, Any]) -> None:
        inner: Any = document
        for key in keys[:-1]:
            inner = inner[key]
        inner[keys[-1]] = to

    return change


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (setting("extensionsUsed", to=["EXT_meshopt_compression"]), "compressed with meshopt"),
        (setting("extensionsRequired", to=["KHR_draco_mesh_compression"]), "compressed with Draco"),
        (
            setting("extensionsRequired", to=["VENDOR_other"]),
            "requires glTF extensions that are not read: VENDOR_other",
        ),
        (setting("accessors", 0, "count", to=10**9), r"accessors\[0\] claims 1000000000 elements"),
        (setting("bufferViews", 0, "byteLength", to=10**12), r"bufferViews\[0\] ends at byte"),
        (setting("bufferViews", 0, "byteOffset", to=-4), "a byteOffset is -4, not a whole number"),
        (setting("accessors", 0, "componentType", to=1), "a type that is not read"),
        (setting("accessors", 0, "sparse", to={}), "is sparse"),
        (setting("nodes", 0, "mesh", to=7), r"names meshes\[7\], which it does not hold"),
        (setting("nodes", 0, "children", to=[0]), "or in a circle"),
        (setting("nodes", 0, "rotation", to="up"), "not well-formed glTF"),
        (setting("meshes", 0, "primitives", to=[]), "holds no triangles"),
        (setting("meshes", to="none"), r"names meshes\[0\]"),
        (setting("nodes", 0, "scale", to=[0, 0, 0]), "all of them degenerate"),
        (setting("buffers", 0, "uri", to="gone.bin"), r"gone\.bin, which cannot be read"),
    ],
)
def test_a_glb_that_promises_what_it_does_not_hold(write_glb: WriteGlb, change: Change, cause: str) -> None:
    path = write_glb(*boxes(), change=change)
    with pytest.raises(SceneError, match=cause) as refused:
        load_scan(path)
    assert str(path) in str(refused.value)


def test_broken_containers(tmp_path: Path) -> None:
    whole = glb_bytes(*boxes())
    path = tmp_path / "room.glb"
    for data, cause in [
        (b"", "does not begin with 'glTF'"),
        (b"{}" * 40, "does not begin with 'glTF'"),
        (whole[:-40], "truncated"),
        (whole[:4] + struct.pack("<I", 1) + whole[8:], "is glTF 1"),
        (whole[:12] + struct.pack("<I", 2**31) + whole[16:], "truncated"),
        (whole[:20] + b"#" + whole[21:], "JSON chunk cannot be read"),
    ]:
        path.write_bytes(data)
        with pytest.raises(SceneError, match=cause):
            load_scan(path)


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0, 1), value=st.integers(0, 255), length=st.floats(0.1, 1))
def test_a_damaged_glb_is_read_or_refused(tmp_path: Path, place: float, value: int, length: float) -> None:
    image = png(np.full((2, 2, 3), 9, np.uint8))
    data = bytearray(glb_bytes(*boxes([ROOM]), uv=np.zeros((8, 2), np.float32), image=image))
    data[int(place * (len(data) - 1))] = value
    path = tmp_path / "room.glb"
    path.write_bytes(bytes(data[: int(length * len(data))] if length < 0.9 else data))
    said = str(path)
    triangles = 0
    try:
        triangles = len(read_glb(path).triangles)
    except SceneError as error:
        said = str(error)
    assert str(path) in said
    assert triangles <= 12


def test_broken_values(write_glb: WriteGlb) -> None:
    vertices, triangles = boxes()
    nan = vertices.copy()
    nan[5, 1] = np.nan
    with pytest.raises(SceneError, match="1 vertices that are NaN or infinite, the first at 5"):
        load_scan(write_glb(nan, triangles))
    with pytest.raises(SceneError, match="names vertex 99 of 16"):
        load_scan(write_glb(vertices, np.where(triangles == 3, 99, triangles)))
    with pytest.raises(SceneError, match=r"room\.glb is 1e\+09 m wide, which no home is; say its units"):
        load_scan(write_glb(vertices / 5 * 1e9, triangles))
    with pytest.raises(SceneError, match="12 triangles, all of them degenerate"):
        load_scan(write_glb(vertices, np.zeros((12, 3), np.int32)))


def test_degenerate_triangles_are_left_out(write_glb: WriteGlb) -> None:
    vertices, triangles = boxes()
    scan = load_scan(write_glb(vertices, np.concatenate([triangles, np.zeros((3, 3), np.int32)])))
    assert len(scan.scene.triangles) == 24
    assert "left out: 3 degenerate triangles" in scan.notes


def test_an_image_that_is_none(write_glb: WriteGlb) -> None:
    for image, cause in [(b"no image", "image 0 cannot be decoded"), (b"\xabKTX 20\xbb\r\n\x1a\n...", "KTX2 texture")]:
        path = write_glb(*boxes([ROOM]), uv=np.zeros((8, 2), np.float32), image=image)
        with pytest.raises(SceneError, match=cause):
            load_scan(path)


def test_broken_obj_and_ply(tmp_path: Path) -> None:
    vertices, triangles = boxes()
    ply = ply_bytes(vertices, triangles, np.zeros((16, 3), np.uint8))
    obj = obj_text(vertices, triangles)
    for name, data, cause in [
        ("a.ply", ply[:-200], "truncated"),
        ("b.ply", b"ply\nformat ascii 1.0\n", "not a PLY file"),
        ("c.ply", b"solid room", "not a PLY file"),
        ("d.obj", b"", "d.obj"),
        ("e.obj", obj.replace("f 2", "f 99").encode(), "e.obj"),
        ("f.obj", obj.replace("v 5.000000", "v nan").encode(), "NaN"),
        ("g.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "g.obj"),
    ]:
        path = tmp_path / name
        path.write_bytes(data)
        with pytest.raises(SceneError, match=cause):
            load_scan(path)


def test_paths_that_are_no_scans(tmp_path: Path, write_glb: WriteGlb) -> None:
    with pytest.raises(SceneError, match="does not exist"):
        load_scan(tmp_path / "gone.glb")
    with pytest.raises(SceneError, match="holds no GLB, OBJ or PLY"):
        load_scan(tmp_path)
    (tmp_path / "room.dae").write_text("<COLLADA/>")
    with pytest.raises(SceneError, match=r"room\.dae is not GLB, OBJ or PLY; COLLADA loses triangles"):
        load_scan(tmp_path / "room.dae")
    write_glb(*boxes(), name="a.glb")
    path = write_glb(*boxes(), name="b.glb")
    with pytest.raises(SceneError, match="holds 2 scans; give one of them"):
        load_scan(tmp_path)
    with pytest.raises(SceneError, match="leaves nothing of a home"):
        load_scan(path, ScanOptions(decimate=3))
    with pytest.raises(SceneError, match="units must be one of m, cm, mm, inch, not 'km'"):
        load_scan(path, ScanOptions(units="km"))  # type: ignore[arg-type]
    path.with_suffix(".json").write_text(
        '{"spatialEntities": [{"semanticLabel_META": "COUCH", "bounded3D_META": {}}, 3]}'
    )
    with pytest.raises(SceneError, match=r"b\.json is not a room capture"):
        load_scan(path)


def test_a_thing_without_a_floor_is_refused(write_glb: WriteGlb) -> None:
    with pytest.raises(SceneError, match="no floor that one can stand on"):
        load_scan(write_glb(*boxes([(0.0, 0.0, 0.0, 0.3, 2.0, 0.3)])))
