"""Habitat's episode files: nothing is lost, and what is wrong is named."""

import copy
import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from thinknav_sim.habitat import (
    EpisodeFileError,
    HabitatDataset,
    HabitatFile,
    read_dataset,
    read_file,
    write_dataset,
    write_file,
)

REAL_FILES = (
    "mp3d_17DRP5sb8fy/17DRP5sb8fy_1000.json.gz",
    "hm3d_val_mini/objectnav/hm3d/v2/val_mini/val_mini.json.gz",
    "hm3d_val_mini/objectnav/hm3d/v2/val_mini/content/TEEsavR23oF.json.gz",
    "hm3d_val_mini/objectnav/hm3d/v2/val_mini/content/wcojb4TFT35.json.gz",
)
EPISODE = {
    "episode_id": "7",
    "scene_id": "hm3d/val/00800-Abc/Abc.basis.glb",
    "scene_dataset_config": "./hm3d.json",
    "additional_obj_config_paths": [],
    "start_position": [1.5, 0.0, -2],
    "start_rotation": [0, 0.86832, 0, 0.49599],
    "info": {"geodesic_distance": 5.4, "euclidean_distance": 4.9, "closest_goal_object_id": 3, "ours": [1, None]},
    "goals": [],
    "start_room": None,
    "shortest_paths": [[1, 2, None]],
    "object_category": "bed",
}
GOAL = {
    "position": [1.0, 0.5, 2.0],
    "radius": None,
    "object_id": 3,
    "object_name": "bed_3",
    "object_category": "bed",
    "room_id": None,
    "view_points": [{"agent_state": {"position": [1, 0, 3], "rotation": [0.0, 0.0, 0.0, 1.0]}, "iou": 1.2}],
}
DOCUMENT = {
    "goals_by_category": {"Abc.basis.glb_bed": [GOAL]},
    "episodes": [EPISODE, copy.deepcopy(EPISODE) | {"episode_id": 8, "a_key_of_tomorrow": {"deep": [True]}}],
    "category_to_task_category_id": {"bed": 1},
    "category_to_mp3d_category_id": {"bed": 11},
}


def put(path: Path, document: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(json.dumps(document).encode()))
    return path


def raw(path: Path) -> Any:
    return json.loads(gzip.decompress(path.read_bytes()))


def changed(*place: str | int, value: Any) -> Any:
    """The document with the value at a place replaced; "absent" takes the key away."""
    document: Any = copy.deepcopy(DOCUMENT)
    inner = document
    for key in place[:-1]:
        inner = inner[key]
    if value == "absent":
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    return document


def test_every_key_is_kept(tmp_path: Path) -> None:
    file = read_file(put(tmp_path / "a.json.gz", DOCUMENT))
    write_file(file, tmp_path / "b.json.gz")
    assert raw(tmp_path / "b.json.gz") == DOCUMENT
    assert read_file(tmp_path / "b.json.gz") == file


@pytest.mark.parametrize("name", REAL_FILES)
def test_real_files_are_kept_whole(real_data: Path, tmp_path: Path, name: str) -> None:
    file = read_file(real_data / name)
    write_file(file, tmp_path / "copy.json.gz")
    assert raw(tmp_path / "copy.json.gz") == raw(real_data / name)
    assert read_file(tmp_path / "copy.json.gz") == file


def test_real_episodes_find_their_goals(real_data: Path) -> None:
    val_mini = read_dataset(real_data / "hm3d_val_mini/objectnav/hm3d/v2/val_mini")
    mp3d = read_dataset(real_data / REAL_FILES[0])
    assert list(val_mini.content) == ["TEEsavR23oF", "wcojb4TFT35"]
    assert (len(val_mini.episodes), len(mp3d.episodes)) == (30, 1000)
    for dataset in (val_mini, mp3d):
        for file in dataset.files:
            for episode in file.episodes:
                goals = file.goals_of(episode)
                assert {goal.object_category for goal in goals} == {episode.object_category}
                assert any(goal.view_points for goal in goals)
                assert (episode.info or {})["closest_goal_object_id"] in {goal.object_id for goal in goals}


def test_a_split_is_an_index_and_content_by_scene(tmp_path: Path) -> None:
    content = HabitatFile.model_validate(DOCUMENT)
    index = HabitatFile.model_validate(DOCUMENT | {"episodes": [], "goals_by_category": {}})
    dataset = HabitatDataset(index=index, content={"Abc": content})
    path = write_dataset(dataset, tmp_path, "val")
    assert path == tmp_path / "val" / "val.json.gz"
    assert raw(tmp_path / "val/content/Abc.json.gz") == DOCUMENT
    for place in (path, path.parent):
        assert read_dataset(place) == dataset
    assert [episode.episode_id for episode in dataset.episodes] == ["7", 8]
    assert dataset.episodes[0].scene_name == "Abc"


def test_the_same_episodes_give_the_same_bytes(tmp_path: Path) -> None:
    file = HabitatFile.model_validate(DOCUMENT)
    for name in ("a.json.gz", "b.json.gz"):
        write_file(file, tmp_path / name)
    assert (tmp_path / "a.json.gz").read_bytes() == (tmp_path / "b.json.gz").read_bytes()


def test_uncompressed_files_are_read_and_written(tmp_path: Path) -> None:
    write_file(HabitatFile.model_validate(DOCUMENT), tmp_path / "plain.json")
    assert json.loads((tmp_path / "plain.json").read_text()) == DOCUMENT
    assert read_file(tmp_path / "plain.json") == HabitatFile.model_validate(DOCUMENT)


VIEW = ("goals_by_category", "Abc.basis.glb_bed", 0, "view_points", 0)


@pytest.mark.parametrize(
    ("document", "complaint"),
    [
        (
            changed("episodes", 0, "start_position", value="absent"),
            r"episode 0 \(id '7'\), field 'start_position': fie",
        ),
        (changed("episodes", 1, "start_position", 2, value="x"), r"episode 1 \(id 8\), field 'start_position\[2\]': "),
        (changed("episodes", 1, "start_position", value=[1, 2]), r"episode 1 \(id 8\), field 'start_position\[2\]': "),
        (changed("episodes", 1, "start_position", 0, value=float("nan")), r"'start_position\[0\]': .* finite number"),
        (changed("episodes", 1, "start_rotation", 3, value=2.0), r"\(id 8\), field 'start_rotation': .* length 2.18"),
        (changed("episodes", 1, "start_rotation", value=[0.7071068, 0, 0, 0.7071068]), "looks straight up or down"),
        (changed("episodes", 1, "object_category", value=None), r"episode 1 \(id 8\), field 'object_category': "),
        (changed("episodes", 1, "object_category", value="\ud800"), r"'object_category': .* surrogates not allowed"),
        (changed("episodes", 1, "scene_id", value="a/\udcff.glb"), r"'scene_id': .* surrogates not allowed"),
        (changed("episodes", 0, "episode_id", value="\ud800"), r"surrogates not allowed"),
        (changed("episodes", 0, "episode_id", value="absent"), r"episode 0, field 'episode_id': field required"),
        (changed("episodes", 0, value=3), r"episode 0: "),
        (changed("episodes", value="absent"), r"the file, field 'episodes': field required"),
        (
            changed(*VIEW, "agent_state", "rotation", value=[0, 1]),
            r"_bed\.?\[0\]\.view_points\[0\]\.agent_state\.rotat",
        ),
        ([], "the file: "),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, document: Any, complaint: str) -> None:
    with pytest.raises(EpisodeFileError, match=rf"bad\.json\.gz: .*{complaint}"):
        read_file(put(tmp_path / "bad.json.gz", document))


def test_files_that_are_not_such_files(tmp_path: Path) -> None:
    whole = put(tmp_path / "whole.json.gz", DOCUMENT).read_bytes()
    (tmp_path / "cut.json.gz").write_bytes(whole[:-40])
    (tmp_path / "text.json").write_text("{]")
    (tmp_path / "other.bin").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "long.json").write_text('{"episodes": ' + "1" * 5000 + "}")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    for name, complaint in (
        ("cut.json.gz", "not a whole gzip file"),
        ("text.json", "not JSON"),
        ("other.bin", "not JSON"),
        ("long.json", "not JSON"),
        ("deep.json", "not JSON"),
        ("absent.json", "cannot be read: No such file"),
    ):
        with pytest.raises(EpisodeFileError, match=complaint):
            read_file(tmp_path / name)
    with pytest.raises(EpisodeFileError, match=r"has no .*\.json\.gz in it"):
        read_dataset(tmp_path)
    with pytest.raises(EpisodeFileError, match="cannot be written"):
        write_file(HabitatFile.model_validate(DOCUMENT), tmp_path / "text.json" / "below.json")
