"""Episode files in Habitat's format, with their scenes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.sim.conftest import build_room
from thinknav_sim.episodes import Episode, EpisodeError
from thinknav_sim.habitat import HabitatDataset, HabitatFile, category_ids, to_habitat, write_dataset
from thinknav_sim.homes import generate_home
from thinknav_sim.scans import write_scene
from thinknav_sim.scene import SceneError
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.config import ConfigError, TrainConfig, parse_config
from thinknav_trainer.episode_sets import of_file
from thinknav_trainer.scenes import Homes, make_homes


def write(folder: Path, episodes: list[Episode]) -> Path:
    """A split `mine` of these episodes, without goals: they are found anew."""
    written = [to_habitat(episode, 0) for episode in episodes]
    file = HabitatFile.model_validate({"episodes": written, **category_ids()})
    return write_dataset(HabitatDataset(index=file), folder, "mine")


def ids(episodes: list[Episode]) -> list[str]:
    return [episode.episode_id for episode in episodes]


def renamed(episodes: list[Episode], name: str) -> list[Episode]:
    return [Episode(**(vars(episode) | {"scene_name": name})) for episode in episodes]


def test_procedural_homes_are_made_again_by_their_names(tmp_path: Path, homes: Homes) -> None:
    path = write(tmp_path, homes.train)
    read = of_file(path, None)
    assert ids(read.episodes) == ids(homes.train)
    starts = [episode.start_heading for episode in read.episodes]
    assert starts == pytest.approx([episode.start_heading for episode in homes.train])
    assert [scene.name for scene in read.scenes] == [scene.name for scene in homes.scenes]
    np.testing.assert_array_equal(read.scenes[0].triangles, homes.scenes[0].triangles)
    assert len(of_file(path, None, limit=2).episodes) == 2


def test_scenes_are_found_anywhere_in_a_folder(tmp_path: Path, homes: Homes) -> None:
    path = write(tmp_path, renamed(homes.train, "TEEsavR23oF"))
    inner = tmp_path / "scenes/val/00800-TEEsavR23oF"
    inner.mkdir(parents=True)
    (inner / "TEEsavR23oF.semantic.glb").write_bytes(b"not this one")
    (inner / "TEEsavR23oF.basis.glb").write_bytes(b"nor this: an imported one is there")
    write_scene(inner / "TEEsavR23oF.npz", homes.scenes[0], ())
    (scene,) = of_file(path, tmp_path / "scenes").scenes
    assert scene.name == "TEEsavR23oF"
    assert len(scene.triangles) == len(homes.scenes[0].triangles)


def test_scenes_that_are_not_there_are_named(tmp_path: Path, homes: Homes) -> None:
    path = write(tmp_path, renamed(homes.train, "TEEsavR23oF"))
    with pytest.raises(SceneError, match=r"plays in 1 scenes .* such as 'TEEsavR23oF': no folder of scenes was given"):
        of_file(path, None)
    (tmp_path / "scenes").mkdir()
    with pytest.raises(SceneError, match=r"scenes there is no TEEsavR23oF.glb \(nor .npz, .basis.glb"):
        of_file(path, tmp_path / "scenes")
    with pytest.raises(SceneError, match="scenes' folder absent does not exist"):
        of_file(path, Path("absent"))


def test_dots_in_names_tell_scenes_apart(tmp_path: Path, homes: Homes) -> None:
    path = write(tmp_path, renamed(homes.train, "flat.3"))
    (tmp_path / "scenes").mkdir()
    for name, scene in (("flat.2", generate_home(1, 2)), ("flat.3", homes.scenes[0])):
        write_scene(tmp_path / f"scenes/{name}.npz", scene, ())
    (scene,) = of_file(path, tmp_path / "scenes").scenes
    np.testing.assert_array_equal(scene.triangles, homes.scenes[0].triangles)


def test_two_scenes_of_one_name_are_refused_and_copies_are_not(tmp_path: Path, homes: Homes) -> None:
    path = write(tmp_path, renamed(homes.train, "flat"))
    for folder, scene in (("minival", homes.scenes[0]), ("val", homes.scenes[0]), ("other", generate_home(1, 2))):
        if folder == "other":
            assert len(of_file(path, tmp_path / "scenes").scenes) == 1
        write_scene(tmp_path / f"scenes/{folder}/flat.npz", scene, ())
        # An ending that is not taken does not matter.
        (tmp_path / f"scenes/{folder}/flat.glb").write_text(folder)
    with pytest.raises(SceneError, match=r"minival.flat\.npz and .*other.flat\.npz are two scenes of one name"):
        of_file(path, tmp_path / "scenes")


def test_episodes_on_another_storey_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A flat of 8 x 6 m, and above a part of it one of 4 x 5 m that a wardrobe below lies under."""
    walls = [(0.0, 2.7, 0.0, 4.0, 2.8, 5.0), (4.0, 2.8, 0.0, 4.1, 5.0, 5.0), (1.0, 0.0, 0.0, 3.0, 2.3, 2.0)]
    room = build_room((8.0, 6.0), walls, [("sofa", (6.0, 0.0, 1.0, 7.0, 0.8, 3.0))], "maisonette")
    (tmp_path / "scenes").mkdir()
    scene = replace(room, level_floors=False, floors=(0.0, 2.8))
    write_scene(tmp_path / "scenes/maisonette.npz", scene, ())
    below, *above = (
        Episode(f"at {place}", "maisonette", place, 0.0, "sofa", 3.0, 3.0)
        for place in ((5.0, 0.0, 5.0), (3.5, 2.8, 4.0), (2.0, 2.8, 1.0))
    )
    with pytest.raises(EpisodeError, match=r"2 of the 2 episodes of .* start on another storey .* none is left"):
        of_file(write(tmp_path / "above", above), tmp_path / "scenes")
    assert not caplog.messages
    read = of_file(write(tmp_path, [*above, below]), tmp_path / "scenes")
    assert ids(read.episodes) == [below.episode_id]
    assert "2 of the 3 episodes" in caplog.text
    assert "start on another storey of their scene" in caplog.text
    ObjectNavVectorEnv(read.scenes, read.episodes, 1).close()


def test_a_run_trains_on_a_file(tmp_path: Path, homes: Homes, smoke: TrainConfig) -> None:
    path = write(tmp_path, homes.train)
    scenes = smoke.scenes.model_copy(update={"episodes_file": str(path), "held_out": 0.2})
    made = make_homes(smoke.model_copy(update={"scenes": scenes}))
    assert sorted(ids([*made.train, *made.held_out])) == sorted(ids(homes.train))
    assert len(made.held_out) == round(0.2 * len(homes.train))
    more = make_homes(smoke.model_copy(update={"scenes": scenes.model_copy(update={"validation": 0.2})}))
    assert ids(more.held_out) == ids(made.held_out)
    assert len(more.validation) > 0
    assert sorted(ids([*more.train, *more.validation])) == sorted(ids(made.train))
    with pytest.raises(ConfigError, match="scans and episodes_file exclude each other"):
        parse_config({"scenes": {"scans": ["a.glb"], "episodes_file": "b.json.gz"}})
