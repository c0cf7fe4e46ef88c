from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_trainer.checkpoint import Checkpoint, CheckpointError

ACTIONS = ("stop", "move_forward", "turn_left", "turn_right", "think")


def checkpoint(**changes: object) -> Checkpoint:
    values = {
        "config": {"seed": 1},
        "action_space": ACTIONS,
        "embedding_space": "words@1234",
        "thought_size": 512,
        "steps": 640,
        "policy": {"weight": torch.arange(3.0)},
        "state": {
            "poses": np.arange(4.0),
            "flags": np.array([True, False]),
            "generator": np.random.default_rng(5).bit_generator.state,
            "nested": [{"a": None, "b": (1, "x")}],
        },
    }
    return Checkpoint(**(values | changes))  # type: ignore[arg-type]


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    path = tmp_path / "checkpoints" / "1.pt"
    checkpoint().save(path)
    loaded = Checkpoint.load(path)
    assert (loaded.steps, loaded.action_space, loaded.embedding_space) == (640, ACTIONS, "words@1234")
    torch.testing.assert_close(loaded.policy["weight"], torch.arange(3.0))
    assert loaded.state["poses"].tolist() == [0, 1, 2, 3]
    assert loaded.state["flags"].dtype == bool
    generator = np.random.default_rng()
    generator.bit_generator.state = loaded.state["generator"]
    assert generator.random() == np.random.default_rng(5).random()
    assert loaded.state["nested"] == [{"a": None, "b": [1, "x"]}]
    assert [file.name for file in path.parent.iterdir()] == ["1.pt"]  # nothing left aside


def test_files_that_are_no_checkpoint_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"there is no checkpoint .*absent\.pt"):
        Checkpoint.load(tmp_path / "absent.pt")
    whole = tmp_path / "whole.pt"
    checkpoint().save(whole)
    data = whole.read_bytes()
    for name, content in (("empty", b""), ("text", b"hello"), ("cut", data[: len(data) // 2])):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(CheckpointError, match=f"{name} is no checkpoint, or damaged"):
            Checkpoint.load(tmp_path / name)
    torch.save({"weights": 1}, tmp_path / "foreign.pt")
    with pytest.raises(CheckpointError, match="not a ThinkNav checkpoint of format 2"):
        Checkpoint.load(tmp_path / "foreign.pt")


def test_code_in_a_checkpoint_is_not_run(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return Path.touch, (str(tmp_path / "sprung"),)

    torch.save({"thinknav_checkpoint": 2, "trap": Trap()}, tmp_path / "trap.pt")
    with pytest.raises(CheckpointError, match="is no checkpoint, or damaged"):
        Checkpoint.load(tmp_path / "trap.pt")
    assert not (tmp_path / "sprung").exists()


def test_another_action_space_is_refused_and_both_are_named() -> None:
    with pytest.raises(CheckpointError, match=r"\[.*turn_right, think\], here they are \[.*turn_right\]"):
        checkpoint().require(ACTIONS[:4], "words@1234")


def test_another_embedding_space_is_refused_and_both_are_named() -> None:
    with pytest.raises(CheckpointError, match="words@1234, the planner here gives clip@5678"):
        checkpoint().require(ACTIONS, "clip@5678")
    checkpoint().require(ACTIONS, "words@1234")


def test_a_checkpoint_that_lacks_something_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "1.pt"
    checkpoint().save(path)
    values = torch.load(path, weights_only=True)
    for name in ("steps", "action_space"):
        torch.save({key: value for key, value in values.items() if key != name}, path)
        with pytest.raises(CheckpointError, match=rf"1\.pt is a checkpoint that lacks something: .*{name}"):
            Checkpoint.load(path)


@pytest.fixture(scope="module")
def damaged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("damaged") / "1.pt"
    checkpoint().save(path)
    return path


@pytest.mark.filterwarnings("ignore:Detected pickle protocol")
@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_whatever_bytes_are_damaged_the_file_is_named(damaged: Path, data: st.DataObject) -> None:
    """Zip archive, pickle and tensors alike: a run that goes on takes the checkpoint before then."""
    content = damaged.read_bytes()
    spoilt = bytearray(content)
    for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=3)):
        spoilt[place] = data.draw(st.integers(0, 255))
    path = damaged.with_name("spoilt.pt")
    path.write_bytes(spoilt)
    with suppress(CheckpointError):  # some bytes do not matter
        Checkpoint.load(path)
