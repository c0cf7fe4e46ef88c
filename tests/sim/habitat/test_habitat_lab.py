"""Habitat-Lab's own loader finds in an episode file what ours finds. Skipped where Habitat-Lab is not installed."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from thinknav_sim.habitat import HabitatFile, read_file

READER = Path(__file__).with_name("habitat_lab_reader.py")
RECORDED = (
    "mp3d_17DRP5sb8fy/17DRP5sb8fy_1000.json.gz",
    "hm3d_val_mini/objectnav/hm3d/v2/val_mini/content/TEEsavR23oF.json.gz",
    "hm3d_val_mini/objectnav/hm3d/v2/val_mini/content/wcojb4TFT35.json.gz",
)

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("habitat") is None, reason="habitat-lab is not installed: docs/habitat.md says how"
)


def read_by_habitat(path: Path) -> dict[str, Any]:
    done = subprocess.run([sys.executable, str(READER), str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def read_by_us(file: HabitatFile) -> dict[str, Any]:
    episodes = [
        {
            "scene_id": episode.scene_id,
            "object_category": episode.object_category,
            "start_position": list(episode.start_position),
            "start_rotation": list(episode.start_rotation),
            "geodesic_distance": (episode.info or {})["geodesic_distance"],
            "goals_key": episode.goals_key,
            "goals": len(file.goals_of(episode)),
        }
        for episode in file.episodes
    ]
    goals = {
        key: [
            [goal.object_id, list(goal.position), [list(view.agent_state.position) for view in goal.view_points]]
            for goal in found
        ]
        for key, found in file.goals_by_category.items()
    }
    return {"episodes": episodes, "goals": goals}


def test_habitat_reads_what_we_write(tmp_path: Path) -> None:
    options = ["--output", str(tmp_path / "made"), "--homes", "1", "--among", "1", "--rooms", "2", "--episodes", "6"]
    program = "from thinknav_trainer.cli import main; main()"
    subprocess.run([sys.executable, "-c", program, "episodes", "make", *options], check=True, capture_output=True)
    [path] = (tmp_path / "made" / "train" / "content").iterdir()
    found = read_by_habitat(path)
    assert found == read_by_us(read_file(path))
    assert found["episodes"]
    assert all(episode["goals"] > 0 for episode in found["episodes"])
    assert all(viewpoints for goals in found["goals"].values() for _, _, viewpoints in goals)


@pytest.mark.parametrize("name", RECORDED)
def test_habitat_reads_recorded_files_as_we_do(real_data: Path, name: str) -> None:
    found = read_by_habitat(real_data / name)
    assert found == read_by_us(read_file(real_data / name))
    assert found["episodes"]
