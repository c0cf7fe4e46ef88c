"""What stands in a scan: room captures, HM3D's painted meshes, floating fragments; and playing in it."""

from pathlib import Path

import numpy as np
import pytest

from tests.sim.scans.conftest import WriteGlb
from tests.sim.scans.files import ROOM, SOFA, boxes, capture_text, glb_bytes, png
from thinknav_sim import NavigationGrid, ObjectNavVectorEnv, make_episodes
from thinknav_sim.render import Renderer
from thinknav_sim.scans import load_scan
from thinknav_sim.scans.labels import category_of
from thinknav_sim.scene import GOAL_CATEGORIES, Scene, SceneError

BED = (3.5, 0.0, 2.2, 4.8, 0.5, 3.8)


def play(scene: Scene, renderer: Renderer) -> None:
    grid = NavigationGrid.from_scene(scene, renderer)
    episodes = make_episodes(scene, grid, 8, 0, min_distance=0.3, renderer=renderer)
    env = ObjectNavVectorEnv([scene], list(episodes), num_envs=2)
    observations, _ = env.reset(seed=0)
    rgb = observations["rgb"]
    assert rgb.std() > 1
    for action in (1, 2, 1, 0):
        _, rewards, *_ = env.step(np.full(2, action))
        assert np.isfinite(rewards).all()
    env.close()


@pytest.mark.parametrize(
    ("label", "category"),
    [
        ("COUCH", "sofa"),
        ("SCREEN", "tv_monitor"),
        ("PLANT", "plant"),
        ("Potted Plant", "plant"),
        ("DOOR_FRAME", "door_frame"),
        ("refrigerator cabinet", "refrigerator_cabinet"),
        ("WALL_FACE", None),
        ("ceiling", None),
    ],
)
def test_labels(label: str, category: str | None) -> None:
    assert category_of(label) == category


def test_a_box_of_a_room_capture_has_the_triangles_in_it(write_glb: WriteGlb, renderer: Renderer) -> None:
    path = write_glb(*boxes())
    path.with_suffix(".json").write_text(capture_text("COUCH", SOFA))
    scene = load_scan(path).scene
    (sofa,) = scene.objects
    assert sofa.category == "sofa"
    np.testing.assert_allclose([*sofa.box.low, *sofa.box.high], SOFA, atol=1e-6)
    # Ten of the box: the sole, flat on the floor, belongs to the floor.
    assert (scene.triangle_objects[12:] == 0).sum() == 10
    assert (scene.triangle_objects[:12] == -1).all()
    play(scene, renderer)


@pytest.mark.parametrize("paint", ["texture", "vertex colours"])
def test_an_hm3d_folder(tmp_path: Path, renderer: Renderer, paint: str) -> None:
    folder = tmp_path / "00800-TEEsavR23oF"
    folder.mkdir()
    vertices, triangles = boxes([ROOM, SOFA, BED])
    lying = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
    painted = np.repeat(np.array([(1, 2, 3), (0x23, 0x69, 0x4C), (0xAA, 0, 0xFF)], np.uint8), 8, axis=0)
    uv = np.stack([np.repeat((np.arange(3) + 0.5) / 3, 8), np.full(24, 0.5)], axis=1).astype(np.float32)
    alktx2 = pytest.importorskip("alktx2")
    stripes = np.repeat(np.array([40, 120, 220], np.uint8), 8)[None, :, None] * np.ones((8, 1, 3), np.uint8)
    walls = alktx2.encode_bytes_to_ktx2(png(stripes), mime="image/png", codec="etc1s")
    (folder / "TEEsavR23oF.basis.glb").write_bytes(glb_bytes(lying, triangles, uv=uv, image=walls))
    # The corners of every triangle lie in unpainted texels, its middle in the painted row between them.
    odd = (np.arange(24) % 8)[:, None] >> np.arange(3) & 1
    over_edges = np.stack([uv[:, 0], np.where(odd.sum(axis=1) % 2, 0.9, 0.1)], axis=1).astype(np.float32)
    rows = np.zeros((3, 3, 3), np.uint8)
    rows[1] = painted[::8]
    semantic = (
        glb_bytes(lying, triangles, uv=over_edges, image=png(rows))
        if paint == "texture"
        else glb_bytes(lying, triangles, colors=painted)
    )
    (folder / "TEEsavR23oF.semantic.glb").write_bytes(semantic)
    (folder / "TEEsavR23oF.basis.navmesh").write_bytes(b"not needed")
    (folder / "TEEsavR23oF.semantic.txt").write_text(
        'HM3D Semantic Annotations\n1,010203,"wall",0\n2,23694C,"couch",0\n3,AA00FF,"bed",0\n4,00FF00,"vase",0\n'
    )
    scan = load_scan(folder)
    scene = scan.scene
    assert scene.name == "TEEsavR23oF"
    assert scan.notes[:2] == ("units: m (HM3D's)", "up-axis: z (HM3D's)")
    assert [instance.category for instance in scene.objects] == ["sofa", "bed"]
    np.testing.assert_allclose([*scene.objects[1].box.low, *scene.objects[1].box.high], BED, atol=1e-6)
    np.testing.assert_array_equal(scene.triangle_objects, np.repeat([-1, 0, 1], 12))
    assert len(scene.textures) == 1
    play(scene, renderer)


def test_hm3d_files_that_do_not_fit_together_are_refused(tmp_path: Path) -> None:
    vertices, triangles = boxes()
    (tmp_path / "X.basis.glb").write_bytes(glb_bytes(vertices, triangles))
    (tmp_path / "X.semantic.glb").write_bytes(glb_bytes(vertices, triangles, colors=np.zeros((16, 3), np.uint8)))
    with pytest.raises(SceneError, match=r"X\.semantic\.txt cannot be read"):
        load_scan(tmp_path)
    text = tmp_path / "X.semantic.txt"
    text.write_text("something else\n")
    with pytest.raises(SceneError, match="does not begin with 'HM3D Semantic Annotations'"):
        load_scan(tmp_path)
    text.write_text('HM3D Semantic Annotations\n1,zzz,"chair",0\n')
    with pytest.raises(SceneError, match="line 2: expected id,colour"):
        load_scan(tmp_path)
    text.write_text('HM3D Semantic Annotations\n1,FFFFFF,"chair",0\n')
    with pytest.raises(SceneError, match="none of the colours"):
        load_scan(tmp_path)


def test_fragments_in_the_air_are_left_out_and_things_on_tables_are_not(write_glb: WriteGlb) -> None:
    crumb = (2.0, 1.5, 2.0, 2.05, 1.55, 2.05)
    cup = (1.0, 0.8, 0.6, 1.08, 0.9, 0.68)  # stands on the sofa
    scan = load_scan(write_glb(*boxes([ROOM, SOFA, crumb, cup])))
    assert len(scan.scene.triangles) == 36
    assert "left out: 12 triangles of fragments that float in the air" in scan.notes
    assert not (np.abs(scan.scene.vertices - np.array(crumb[:3])) < 0.01).all(axis=1).any()


def test_what_a_thin_pole_holds_up_does_not_float(write_glb: WriteGlb) -> None:
    pole = (3.0, 0.0, 2.0, 3.02, 1.5, 2.02)
    shade = (2.95, 1.3, 1.95, 3.07, 1.42, 2.07)  # pierced by it
    plate = (2.91, 1.5, 1.91, 3.11, 1.51, 2.11)  # lies on its tip
    scan = load_scan(write_glb(*boxes([ROOM, SOFA, pole, shade, plate])))
    assert len(scan.scene.triangles) == 60


@pytest.mark.parametrize(("room", "sofas", "area"), [("living_room", 1, (9, 14)), ("music_room", 2, (6, 11))])
def test_a_scanned_room_is_played_in(
    test_data: Path, renderer: Renderer, room: str, sofas: int, area: tuple[float, float]
) -> None:
    scan = load_scan(test_data / "quest_rooms" / f"{room}.glb")
    scene = scan.scene
    assert scan.notes[0].startswith("units: m ")
    assert scan.notes[1].startswith("up-axis: y ")
    assert len(scene.objects_of("sofa")) == sofas
    assert len(scene.floors) == 1
    assert abs(scene.floors[0]) < 0.05
    for instance in scene.objects:
        if instance.category in GOAL_CATEGORIES:
            assert (scene.triangle_objects == instance.object_id).sum() > 1000
    grid = NavigationGrid.from_scene(scene, renderer)
    assert area[0] < grid.navigable.sum() * grid.cell**2 < area[1]
    # Nobody walks on the furniture.
    assert np.nanmax(grid.floor[grid.navigable]) < 0.15
    play(scene, renderer)
