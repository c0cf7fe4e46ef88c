"""From a file to a scene: formats, units, axes, colours, textures, decimation, the cache."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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
from thinknav_sim.scene import Scene, SceneError


def extent(scene: Scene) -> list[float]:
    return [round(float(size), 3) for size in np.ptp(scene.vertices, axis=0)]


def assert_same(one: Scene, other: Scene) -> None:
    for field in fields(Scene):
        if field.name == "objects":
            assert [(o.category, *o.box.low, *o.box.high) for o in one.objects] == [
                (o.category, *o.box.low, *o.box.high) for o in other.objects
            ]
        elif field.name == "textures":
            assert all(np.array_equal(a, b) for a, b in zip(one.textures, other.textures, strict=True))
        else:
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


def test_a_glb_becomes_a_scene_of_metres(write_glb: WriteGlb) -> None:
    scan = load_scan(write_glb(*boxes()))
    assert scan.scene.name == "room"
    assert len(scan.scene.triangles) == 24
    assert extent(scan.scene) == [5.0, 2.5, 4.0]
    assert scan.scene.floors == (0.0,)
    assert not scan.scene.level_floors
    assert "units: m (guessed: then it is 5.0 m wide and 2.5 m high)" in scan.notes


@pytest.mark.parametrize(("units", "scale"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("inch", 0.0254)])
@pytest.mark.parametrize("given", [True, False])
def test_units_are_given_or_guessed(write_glb: WriteGlb, units: str, scale: float, given: bool) -> None:
    vertices, triangles = boxes()
    options = ScanOptions(units=units if given else None)  # type: ignore[arg-type]
    scan = load_scan(write_glb((vertices / scale).astype(np.float32), triangles), options)
    assert extent(scan.scene) == [5.0, 2.5, 4.0]
    assert scan.notes[0].startswith(f"units: {units} (" + ("given" if given else "guessed"))


@pytest.mark.parametrize("given", [True, False])
def test_a_scan_with_z_up_is_put_upright_as_habitat_does(write_glb: WriteGlb, given: bool) -> None:
    vertices, triangles = boxes()
    lying = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
    scan = load_scan(write_glb(lying, triangles), ScanOptions(up_axis="z" if given else None))
    np.testing.assert_allclose(scan.scene.vertices, vertices, atol=1e-6)
    assert scan.notes[1].startswith("up-axis: z (" + ("given" if given else "guessed"))


@pytest.mark.parametrize("width", [1.5, 1.8])
def test_a_narrow_corridor_keeps_the_up_axis_of_its_format(write_glb: WriteGlb, width: float) -> None:
    """Its walls have more surface than its floor."""
    scan = load_scan(write_glb(*boxes([(0.0, 0.0, 0.0, 7.0, 2.5, width)])))
    assert extent(scan.scene) == [7.0, 2.5, width]
    assert scan.notes[1] == "up-axis: y (guessed: as glTF has it; then it is one storey high)"
    assert extent(load_scan(write_glb(*boxes([(0.0, 0.0, 0.0, 7.0, 4.0, 1.4)]))).scene) == [7.0, 4.0, 1.4]


def test_a_scan_with_a_room_capture_has_its_up_axis(write_glb: WriteGlb) -> None:
    path = write_glb(*boxes([(0.0, 0.0, 0.0, 7.0, 4.0, 2.0)]))
    assert extent(load_scan(path).scene) == [7.0, 2.0, 4.0]
    path.with_suffix(".json").write_text(capture_text("COUCH", (0.5, 0.0, 0.3, 2.3, 0.8, 1.1)))
    scan = load_scan(path)
    assert extent(scan.scene) == [7.0, 4.0, 2.0]
    assert scan.notes[1] == "up-axis: y (guessed: that of the room capture)"
    assert load_scan(path, ScanOptions(up_axis="z")).notes[1] == "up-axis: z (given)"


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_obj_and_ply_give_every_triangle(tmp_path: Path, suffix: str) -> None:
    vertices, triangles = boxes()
    colors = np.full((len(vertices), 3), (10, 200, 30), np.uint8)
    path = tmp_path / f"room.{suffix}"
    if suffix == "obj":
        path.write_text(obj_text(vertices, triangles))
    else:
        path.write_bytes(ply_bytes(vertices, triangles, colors))
    scene = load_scan(path).scene
    assert len(scene.triangles) == 24
    assert extent(scene) == [5.0, 2.5, 4.0]
    if suffix == "ply":
        assert (scene.colors == (10, 200, 30)).all()


def test_a_textured_obj_has_its_texture_the_right_way_up(tmp_path: Path) -> None:
    vertices, triangles = boxes([ROOM])
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"vt 0.5 {0.9 if y > 0 else 0.1}" for _, y, _ in vertices]
    faces = ["f " + " ".join(f"{i + 1}/{i + 1}" for i in triangle) for triangle in triangles]
    (tmp_path / "room.obj").write_text("\n".join(["mtllib room.mtl", *lines, "usemtl paint", *faces]) + "\n")
    (tmp_path / "room.mtl").write_text("newmtl paint\nmap_Kd paint.png\n")
    image = np.zeros((8, 8, 3), np.uint8)
    image[:4] = (255, 0, 0)  # the upper half, v from 0.5 to 1 as OBJ measures it
    (tmp_path / "paint.png").write_bytes(png(image))
    scene = load_scan(tmp_path / "room.obj").scene
    assert len(scene.textures) == 1
    ceiling = scene.vertices[:, 1] > 1
    assert (scene.colors[ceiling] == (255, 0, 0)).all()
    assert (scene.colors[~ceiling] == 0).all()


def test_vertex_colors_are_kept_and_a_bare_mesh_is_shaded(write_glb: WriteGlb) -> None:
    vertices, triangles = boxes()
    colors = np.random.default_rng(0).integers(0, 255, (len(vertices), 3)).astype(np.uint8)
    np.testing.assert_array_equal(load_scan(write_glb(vertices, triangles, colors=colors)).scene.colors, colors)
    separate = vertices[triangles].reshape(-1, 3)
    bare = load_scan(write_glb(separate, np.arange(len(separate)).reshape(-1, 3))).scene
    assert len(np.unique(bare.colors, axis=0)) == 3  # one for each axis that a wall can face


@pytest.mark.parametrize("kind", ["png", "ktx2"])
def test_textures_are_drawn_and_baked_into_vertex_colors(write_glb: WriteGlb, kind: str) -> None:
    vertices, triangles = boxes([ROOM])
    pixels = np.zeros((16, 16, 3), np.uint8)
    pixels[:8], pixels[8:] = (220, 40, 40), (40, 40, 220)
    image = png(pixels)
    if kind == "ktx2":
        alktx2 = pytest.importorskip("alktx2")
        image = alktx2.encode_bytes_to_ktx2(image, mime="image/png", codec="uastc")
    uv = np.stack([np.full(8, 0.5), np.where(vertices[:, 1] > 0, 1.1, 0.9)], axis=1).astype(np.float32)
    scene = load_scan(write_glb(vertices, triangles, uv=uv, image=image)).scene
    assert len(scene.textures) == 1
    assert scene.textures[0].shape == (16, 16, 3)
    assert scene.triangle_textures is not None
    assert (scene.triangle_textures == 0).all()
    np.testing.assert_array_equal(scene.uv, uv)
    # v grows downwards, and 1.1 is 0.1 again.
    high = vertices[:, 1] > 0
    np.testing.assert_allclose(scene.colors[high].astype(int), np.tile((220, 40, 40), (4, 1)), atol=4)
    np.testing.assert_allclose(scene.colors[~high].astype(int), np.tile((40, 40, 220), (4, 1)), atol=4)


def test_a_texture_given_with_specular_glossiness_is_drawn(write_glb: WriteGlb) -> None:
    vertices, triangles = boxes([ROOM])

    def glossy(document: dict[str, Any]) -> None:
        (material,) = document["materials"]
        look = {"diffuseTexture": material.pop("pbrMetallicRoughness")["baseColorTexture"]}
        material["extensions"] = {"KHR_materials_pbrSpecularGlossiness": look}
        document["extensionsRequired"] = document["extensionsUsed"] = list(material["extensions"])

    image = png(np.full((4, 4, 3), (200, 30, 30), np.uint8))
    path = write_glb(vertices, triangles, uv=np.zeros((8, 2), np.float32), image=image, change=glossy)
    scene = load_scan(path).scene
    assert len(scene.textures) == 1
    assert (scene.colors == (200, 30, 30)).all()


def test_decimation_keeps_shape_and_baked_colors(write_glb: WriteGlb) -> None:
    steps = np.linspace(0.0, 5.0, 41)
    x, z = (grid.ravel() for grid in np.meshgrid(steps, steps))
    vertices = np.stack([x, np.zeros_like(x), z], axis=1)
    corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    floor = np.stack([corner, corner + 1, corner + 41, corner + 1, corner + 42, corner + 41], axis=1).reshape(-1, 3)
    box, sides = boxes([(2.0, 0.0, 2.0, 3.0, 2.5, 3.0)])
    uv = np.zeros((len(vertices) + 8, 2), np.float32)
    path = write_glb(
        np.concatenate([vertices, box]),
        np.concatenate([floor, sides + len(vertices)]),
        uv=uv,
        image=png(np.full((2, 2, 3), 90, np.uint8)),
    )
    scan = load_scan(path, ScanOptions(decimate=300))
    assert len(load_scan(path).scene.triangles) == 3212
    assert 100 < len(scan.scene.triangles) <= 300
    np.testing.assert_allclose(extent(scan.scene), [5.0, 2.5, 5.0], atol=0.05)
    assert not scan.scene.textures
    assert (scan.scene.colors == 90).all()
    assert any("textures baked" in note for note in scan.notes)


def test_the_second_load_comes_from_the_cache_and_is_the_same(write_glb: WriteGlb, cache: Path) -> None:
    path = write_glb(*boxes())
    path.with_suffix(".json").write_text(capture_text("COUCH", SOFA))
    first, second = load_scan(path), load_scan(path)
    assert (first.cached, second.cached) == (False, True)
    assert first.notes == second.notes
    assert_same(first.scene, second.scene)
    # Other options, other contents, a broken cache: read again.
    assert not load_scan(path, ScanOptions(up_axis="y")).cached
    path.with_suffix(".json").write_text(capture_text("TABLE", SOFA))
    assert load_scan(path).scene.objects[0].category == "table"
    for kept in cache.iterdir():
        kept.write_bytes(kept.read_bytes()[:100])
    assert not load_scan(path).cached
    assert load_scan(path).cached
    assert not [left for left in cache.iterdir() if left.suffix != ".npz"]


@pytest.mark.parametrize("kind", ["glb", "obj", "ply"])
def test_a_scan_is_imported_again_when_a_file_that_it_names_has_changed(tmp_path: Path, kind: str) -> None:
    vertices, triangles = boxes([ROOM])
    path = tmp_path / f"room.{kind}"
    wall = tmp_path / "look" / "wall.png"
    wall.parent.mkdir()
    faces = [[f"{i + 1}/1" for i in triangle] for triangle in triangles]
    if kind == "glb":

        def named(document: dict[str, Any]) -> None:
            document["images"] = [{"uri": "look/wall.png"}]

        path.write_bytes(glb_bytes(vertices, triangles, uv=np.zeros((8, 2), np.float32), image=b"", change=named))
    elif kind == "obj":
        lines = [*(f"v {x} {y} {z}" for x, y, z in vertices), "vt 0.5 0.5", "usemtl paint"]
        path.write_text("\n".join(["mtllib room.mtl", *lines, *("f " + " ".join(face) for face in faces)]) + "\n")
        (tmp_path / "room.mtl").write_text("newmtl paint\nmap_Kd look/wall.png\n")
    else:
        path.write_text(textured_ply_text(vertices, triangles, "comment TextureFile look/wall.png"))
    for color in ((255, 0, 0), (0, 255, 0)):
        wall.write_bytes(png(np.full((4, 4, 3), color, np.uint8)))
        scan = load_scan(path)
        assert not scan.cached
        assert (scan.scene.textures[0] == color).all()
        assert load_scan(path).cached


def test_an_imported_scene_is_loaded_as_it_was_written(write_glb: WriteGlb, tmp_path: Path) -> None:
    vertices, triangles = boxes()
    uv = np.random.default_rng(0).uniform(size=(len(vertices), 2)).astype(np.float32)
    scan = load_scan(write_glb(vertices, triangles, uv=uv, image=png(np.full((4, 4, 3), 7, np.uint8))))
    write_scene(tmp_path / "kept" / "room.npz", scan.scene, scan.notes)
    assert_same(load_scan(tmp_path / "kept" / "room.npz").scene, scan.scene)
    (tmp_path / "other.npz").write_bytes(b"PK not a zip")
    with pytest.raises(SceneError, match=r"other\.npz is not an imported scene"):
        load_scan(tmp_path / "other.npz")
