from pathlib import Path

import numpy as np
import pytest

from thinknav_proto import Frame, PlannerFailed, SubgoalRequest
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import load_config
from thinknav_trainer.planner import reply_to
from thinknav_trainer.run import (
    Run,
    RunError,
    checkpoint_path,
    list_checkpoints,
    newest_checkpoint,
    read_config,
    read_log,
    read_metrics,
)
from thinknav_trainer.thoughts import Thought, embedding_of


def save(run: Run, steps: int) -> None:
    run.checkpoint(Checkpoint({}, ("stop",), None, 0, steps, {}))


def test_a_run_keeps_what_was_logged(tmp_path: Path) -> None:
    config = load_config("smoke")
    run = Run.create(tmp_path / "a", config)
    run.log(10, {"success": 0.5, "not_yet": float("nan")}, {"time/act": 1.5})
    reply = reply_to(
        SubgoalRequest(request_id="1", goal="chair", frame=Frame.raw(np.zeros((1, 1, 3), np.uint8))), "left"
    )
    run.log_thoughts(10, [Thought(1, "chair", reply, 3), Thought(0, "bed", PlannerFailed("no idea"), 3)])
    run.close()
    assert read_config(run.folder) == config
    assert read_metrics(run.folder) == [{"steps": 10, "success": 0.5}]
    assert read_log(run.folder / "timing.jsonl") == [{"steps": 10, "time/act": 1.5}]
    told, failed = read_log(run.folder / "thoughts.jsonl")
    [embedding] = read_log(run.folder / "embeddings.jsonl")
    name = embedding["name"]
    assert told == {"steps": 10, "round": 3, "env": 1, "goal": "chair", "subgoal": "left", "embedding": name}
    assert (failed["subgoal"], failed["error"]["code"]) == (None, "planner_failed")
    np.testing.assert_array_equal(embedding_of(embedding), reply.embedding)
    assert list((run.folder / "tensorboard").glob("events*"))


def test_a_run_is_not_overwritten(tmp_path: Path) -> None:
    Run.create(tmp_path, load_config("smoke")).close()
    with pytest.raises(RunError, match="holds a run already; go on with --resume"):
        Run.create(tmp_path, load_config("smoke"))


def test_resuming_drops_what_was_logged_after_the_checkpoint(tmp_path: Path) -> None:
    config = load_config("smoke")
    run = Run.create(tmp_path, config)
    for steps in (10, 20, 30):
        run.log(steps, {"success": steps / 100}, {})
    run.close()
    with (tmp_path / "metrics.jsonl").open("a") as file:
        file.write('{"steps": 3')  # killed in mid-line
    again = Run(tmp_path, config, steps=20)
    again.log(25, {"success": 0.25}, {})
    again.close()
    assert [row["steps"] for row in read_metrics(tmp_path)] == [10, 20, 25]


def test_the_first_and_the_newest_checkpoints_are_kept(tmp_path: Path) -> None:
    run = Run.create(tmp_path, load_config("smoke", overrides=["keep_checkpoints=2"]))
    for steps in (0, 10, 20, 30, 40):
        save(run, steps)
    run.close()
    assert [int(path.stem) for path in list_checkpoints(tmp_path)] == [0, 30, 40]


def test_resuming_takes_the_newest_checkpoint_that_can_be_read(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="holds no checkpoint to resume from"):
        newest_checkpoint(tmp_path)
    run = Run.create(tmp_path, load_config("smoke"))
    save(run, 10)
    save(run, 20)
    run.close()
    checkpoint_path(tmp_path, 20).write_bytes(b"cut off")
    assert newest_checkpoint(tmp_path).steps == 10


def test_what_a_killed_process_had_begun_to_write_is_removed(tmp_path: Path) -> None:
    config = load_config("smoke")
    Run.create(tmp_path, config).close()
    begun = [tmp_path / ".config.yaml.123", tmp_path / "checkpoints/.0000000010.pt.99"]
    (tmp_path / "checkpoints").mkdir()
    for path in begun:
        path.write_text("half")
    Run(tmp_path, config, steps=0).close()
    assert not any(path.exists() for path in begun)


def test_a_folder_that_is_no_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is no run: cannot read metrics\.jsonl"):
        read_metrics(tmp_path)
    with pytest.raises(RunError, match=r"is no run: cannot read config\.yaml"):
        read_config(tmp_path)
