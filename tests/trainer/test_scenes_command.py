"""`thinknav scenes import`, and training in what it leaves."""

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from tests.sim.scans.files import SOFA, boxes, capture_text, glb_bytes
from thinknav_sim.scene import SceneError
from thinknav_trainer.cli import app
from thinknav_trainer.config import load_config
from thinknav_trainer.scenes import make_homes


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THINKNAV_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def room(tmp_path: Path) -> Path:
    path = tmp_path / "attic.glb"
    path.write_bytes(glb_bytes(*boxes()))
    path.with_suffix(".json").write_text(capture_text("COUCH", SOFA))
    return path


def test_it_says_what_it_found_and_draws_it(room: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["scenes", "import", str(room), "--output", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    for said in [
        "attic (read in",
        "units: m (guessed",
        "up-axis: y (guessed",
        "triangles: 24",
        "extent: 5.00 x 4.00 m, 2.50 m high",
        "floor at 0.00 m: 1",
        "goals: 1 sofa",
        "other objects: none",
    ]:
        assert said in result.output
    with Image.open(tmp_path / "out" / "attic.png") as picture:
        assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 5
    again = CliRunner().invoke(app, ["scenes", "import", str(room), "--output", str(tmp_path / "out")])
    assert "attic (from the cache in" in again.output


def test_options_reach_the_scene(room: Path, tmp_path: Path) -> None:
    arguments = ["scenes", "import", str(room), "--output", str(tmp_path / "out"), "--units", "cm", "--up-axis", "y"]
    room.write_bytes(glb_bytes(boxes()[0] * 100, boxes()[1]))
    result = CliRunner().invoke(app, arguments)
    assert "units: cm (given)" in result.output
    assert "extent: 5.00 x 4.00 m" in result.output


def test_a_broken_file_is_one_error(room: Path, tmp_path: Path) -> None:
    room.write_bytes(b"glTF" + struct.pack("<II", 2, 10**6) + bytes(100))
    result = CliRunner().invoke(app, ["scenes", "import", str(room), "--output", str(tmp_path / "out")])
    assert isinstance(result.exception, SceneError)
    assert "attic.glb is truncated" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_a_second_floor_that_is_too_small_is_told_and_left_out(tmp_path: Path) -> None:
    path = tmp_path / "bathroom.glb"
    path.write_bytes(glb_bytes(*boxes([(0.0, 0.0, 0.0, 2.6, 3.5, 2.2), (0.0, 0.0, 0.0, 2.6, 1.9, 0.5)])))
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["scenes", "import", str(path), "--output", str(out)])
    assert result.exit_code == 0, result.output
    assert "floor at 0.00 m: 2" in result.output
    assert "floor at 1.90 m: left out, too small to stand on" in result.output
    assert (out / "bathroom.png").is_file()
    assert (out / "bathroom.npz").is_file()


def test_scans_take_the_place_of_homes(room: Path, tmp_path: Path) -> None:
    CliRunner().invoke(app, ["scenes", "import", str(room), "--output", str(tmp_path / "out")])
    for path in (room, tmp_path / "out" / "attic.npz"):
        config = load_config(
            "smoke", None, [f"scenes.scans=['{path}']", "scenes.episodes=20", "scenes.min_distance=0.5"]
        )
        homes = make_homes(config)
        assert [scene.name for scene in homes.scenes] == ["attic"]
        assert len(homes.train) + len(homes.held_out) == 20
        assert {episode.object_category for episode in homes.train} == {"sofa"}
    with pytest.raises(SceneError, match="is a second scene called 'attic'"):
        make_homes(load_config("smoke", None, [f"scenes.scans=['{room}','{room}']"]))
