"""Files that make no scene: one clear error that names the file and the cause, never a crash or an empty world."""

import contextlib
import json
import math
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.sim.scans.conftest import WriteGlb
from tests.sim.scans.files import (
    ROOM,
    SOFA,
    boxes,
    capture_text,
    glb_bytes,
    obj_text,
    ply_bytes,
    png,
    textured_ply_text,
)
from thinknav_sim.scans import ScanOptions, load_scan, write_scene
from thinknav_sim.scans.glb_mesh import read_glb
from thinknav_sim.scene import Scene, SceneError

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
        (setting("extensionsUsed", to=None), "extensionsUsed is no list of names"),
        (setting("extensionsRequired", to=[1, "x"]), "extensionsRequired is no list of names"),
        (setting("nodes", 0, "scale", to=[1e300] * 3), "wide in its own units"),
        (setting("nodes", 0, "translation", to=[500_000, 0, 4_500_000]), "4.5e.06 m from the origin"),
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


@pytest.mark.parametrize(("image", "cause"), [(None, "is not there"), (b"no image", "cannot be decoded")])
def test_an_obj_whose_texture_cannot_be_shown(tmp_path: Path, image: bytes | None, cause: str) -> None:
    vertices, triangles = boxes([ROOM])
    lines = [*(f"v {x} {y} {z}" for x, y, z in vertices), "vt 0.5 0.5", "usemtl wall paint"]
    faces = ["f " + " ".join(f"{i + 1}/1" for i in triangle) for triangle in triangles]
    (tmp_path / "room.obj").write_text("\n".join(["mtllib room.mtl", *lines, *faces]) + "\n")
    (tmp_path / "room.mtl").write_text("newmtl other\nmap_Kd gone.png\nnewmtl wall paint\nmap_Kd look/wall.png\n")
    if image is not None:
        (tmp_path / "look").mkdir()
        (tmp_path / "look" / "wall.png").write_bytes(image)
    with pytest.raises(SceneError, match=f"wall.png, which {cause}"):
        load_scan(tmp_path / "room.obj")


def test_a_ply_whose_texture_cannot_be_shown(tmp_path: Path) -> None:
    path = tmp_path / "room.ply"
    path.write_text(textured_ply_text(*boxes([ROOM]), "comment TextureFile wall.png"))
    with pytest.raises(SceneError, match=r"wall\.png, which is not there"):
        load_scan(path)
    (tmp_path / "wall.png").write_bytes(b"no image")
    with pytest.raises(SceneError, match=r"wall\.png, which cannot be decoded"):
        load_scan(path)
    path.write_text(textured_ply_text(*boxes([ROOM]), "comment no texture"))
    assert not load_scan(path).scene.textures


@pytest.mark.parametrize("text", ["[" * 100_000, '{"spatialEntities": 1}'])
def test_a_room_capture_that_is_none(write_glb: WriteGlb, text: str) -> None:
    path = write_glb(*boxes())
    path.with_suffix(".json").write_text(text)
    with pytest.raises(SceneError, match="is not a room capture"):
        load_scan(path)


def test_a_room_capture_with_a_box_nowhere(write_glb: WriteGlb) -> None:
    path = write_glb(*boxes())
    capture = json.loads(capture_text("COUCH", SOFA))
    capture["spatialEntities"][0]["locatable_META"]["position"]["x"] = math.nan
    path.with_suffix(".json").write_text(json.dumps(capture))
    with pytest.raises(SceneError, match="a box of sofa is not finite"):
        load_scan(path)


def test_an_imported_scene_with_a_flipped_bit_is_read_or_refused(write_glb: WriteGlb, tmp_path: Path) -> None:
    scan = load_scan(write_glb(*boxes()))
    write_scene(tmp_path / "kept.npz", scan.scene, scan.notes)
    whole = (tmp_path / "kept.npz").read_bytes()
    for place in range(48):  # the first header of the archive
        for bit in range(8):
            data = bytearray(whole)
            data[place] ^= 1 << bit
            (tmp_path / "kept.npz").write_bytes(data)
            with contextlib.suppress(SceneError):
                load_scan(tmp_path / "kept.npz")


def test_an_imported_scene_without_a_floor_is_refused(empty_room: Scene, tmp_path: Path) -> None:
    write_scene(tmp_path / "roof.npz", replace(empty_room, floors=()), ())
    with pytest.raises(SceneError, match=r"roof\.npz has no floor"):
        load_scan(tmp_path / "roof.npz")


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
