import json
from pathlib import Path

import pytest

from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import load_config
from thinknav_trainer.run import (
    Run,
    RunError,
    checkpoint_path,
    list_checkpoints,
    newest_checkpoint,
    read_config,
    read_metrics,
)


def save(run: Run, steps: int) -> None:
    run.checkpoint(Checkpoint({}, ("stop",), None, 0, steps, {}))


def test_a_run_keeps_what_was_logged(tmp_path: Path) -> None:
    config = load_config("smoke")
    run = Run.create(tmp_path / "a", config)
    run.log(10, {"success": 0.5, "not_yet": float("nan")})
    run.log_thoughts(10, [{"env": 1, "subgoal": "turn left"}])
    run.close()
    assert read_config(run.folder) == config
    assert read_metrics(run.folder) == [{"steps": 10, "success": 0.5}]
    assert json.loads((run.folder / "thoughts.jsonl").read_text()) == {
        "steps": 10,
        "env": 1,
        "subgoal": "turn left",
    }
    assert list((run.folder / "tensorboard").glob("events*"))


def test_a_run_is_not_overwritten(tmp_path: Path) -> None:
    Run.create(tmp_path, load_config("smoke")).close()
    with pytest.raises(RunError, match="holds a run already; go on with --resume"):
        Run.create(tmp_path, load_config("smoke"))


def test_resuming_drops_what_was_logged_after_the_checkpoint(tmp_path: Path) -> None:
    config = load_config("smoke")
    run = Run.create(tmp_path, config)
    for steps in (10, 20, 30):
        run.log(steps, {"success": steps / 100})
    run.close()
    with (tmp_path / "metrics.jsonl").open("a") as file:
        file.write('{"steps": 3')  # killed in mid-line
    again = Run(tmp_path, config, steps=20)
    again.log(25, {"success": 0.25})
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


def test_a_folder_that_is_no_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is no run: cannot read metrics\.jsonl"):
        read_metrics(tmp_path)
    with pytest.raises(RunError, match=r"is no run: cannot read config\.yaml"):
        read_config(tmp_path)
