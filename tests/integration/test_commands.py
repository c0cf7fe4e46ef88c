"""The `thinknav` command in processes of its own, against the real service: the main job, and users' mistakes."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
import torch

from tests.integration.conftest import StartService
from thinknav_trainer.checkpoint import Checkpoint

THINKNAV = str(Path(sys.executable).with_name("thinknav"))
NOWHERE = "http://127.0.0.1:9"  # the discard port: nothing listens there
TIMEOUT_S = 240.0


def thinknav(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder until it ends."""
    return subprocess.run(
        [THINKNAV, *arguments], cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
    )


@contextmanager
def started(folder: Path, *arguments: str) -> Iterator["subprocess.Popen[str]"]:
    """The command in a folder, while the block runs; it does not outlive it."""
    command = [THINKNAV, *arguments]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(path: Path, process: "subprocess.Popen[str]") -> None:
    """Until the process has made a file with something in it."""
    until = time.monotonic() + TIMEOUT_S
    while not (path.exists() and path.stat().st_size):
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < until, f"{path} did not appear"
        time.sleep(0.05)


def one_line(process: "subprocess.CompletedProcess[str]") -> str:
    """What a failed command said; a user's mistake shows no traceback."""
    assert "Traceback" not in process.stderr
    return process.stderr.strip().splitlines()[-1]


def processes_of(words: Sequence[str], folder: Path) -> list[int]:
    """Processes that work in a folder and whose command line holds all the words."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            command = (entry / "cmdline").read_bytes().decode(errors="replace")
            at = (entry / "cwd").resolve(strict=True)
        except OSError:
            continue
        if at == folder.resolve() and all(word in command for word in words):
            found.append(int(entry.name))
    return found


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory, planning_service: str) -> Path:
    """A folder with a trained run `first`, made by the command against the real service."""
    folder = tmp_path_factory.mktemp("work")
    process = thinknav(folder, "train", "--name", "first", "--preset", "smoke", "--planner", planning_service)
    assert process.returncode == 0, process.stderr
    assert "checkpoint: runs/first/checkpoints/0000000256.pt" in process.stdout
    return folder


def test_train_eval_report(trained: Path, planning_service: str) -> None:
    rows = [json.loads(line) for line in (trained / "runs/first/metrics.jsonl").read_text().splitlines()]
    assert rows[-1]["steps"] == 256
    assert rows[-1]["thoughts/asked"] == rows[-1]["thoughts/answered"] > 0
    subgoals = [
        json.loads(line)["subgoal"] for line in (trained / "runs/first/thoughts.jsonl").read_text().splitlines()
    ]
    assert len(set(subgoals)) > 1

    checkpoint = "runs/first/checkpoints/0000000256.pt"
    process = thinknav(trained, "eval", checkpoint, "--planner", planning_service)
    assert process.returncode == 0, process.stderr
    result = json.loads((trained / "runs/first/evaluations/0000000256-held_out/result.json").read_text())
    assert result["protocol"]["checkpoint_steps"] == 256
    assert result["protocol"]["episodes"] >= 3
    assert set(result["summary"]["spl"]) == {"mean", "low", "high"}

    process = thinknav(trained, "report", "runs/first")
    assert process.returncode == 0, process.stderr
    page = (trained / "runs/first/report.html").read_text()
    assert page.count("<svg") >= 5
    assert "data:video/mp4;base64," in page
    assert "data:image/png;base64," in page
    assert "answers from a list and does not look at the" in page


def test_resuming_with_another_strategy_is_refused(trained: Path) -> None:
    process = thinknav(trained, "train", "--name", "first", "--resume", "--set", "think.strategy=never")
    assert process.returncode == 2
    assert "a run that goes on cannot change think.strategy" in one_line(process)


def test_a_checkpoint_of_another_embedding_space_is_refused(trained: Path, planning_service: str) -> None:
    made = Checkpoint.load(trained / "runs/first/checkpoints/0000000256.pt")
    foreign = Checkpoint(**{**vars(made), "embedding_space": "clip-vit-b32@0123"})
    foreign.save(trained / "foreign.pt")
    process = thinknav(trained, "eval", "foreign.pt", "--planner", planning_service)
    assert process.returncode == 2
    assert "clip-vit-b32@0123, the planner here gives thinknav-clip@" in one_line(process)


def test_a_run_is_not_overwritten(trained: Path, planning_service: str) -> None:
    process = thinknav(trained, "train", "--name", "first", "--preset", "smoke", "--planner", planning_service)
    assert process.returncode == 2
    assert "holds a run already; go on with --resume, or give another --name" in one_line(process)


def test_an_absent_planner_is_named_within_ten_seconds(tmp_path: Path) -> None:
    process = thinknav(tmp_path, "train", "--name", "a", "--preset", "smoke", "--planner", NOWHERE)
    assert process.returncode == 2
    said = one_line(process)
    assert NOWHERE in said
    assert "thinknav-server serve" in said
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("train", "--name", "a", "--set", "ppo.clp=1"), "did you mean 'ppo.clip'?"),
        (("train", "--name", "a", "--preset", "cpuu"), "did you mean 'cpu'?"),
        (("train", "--name", "a", "--config", "absent.yaml"), "cannot read absent.yaml"),
        (("train", "--name", "a", "--resume"), "no run"),
        (("eval", "absent.pt"), "there is no checkpoint absent.pt"),
        (("eval",), "give either a checkpoint or --agent"),
        (("eval", "--agent", "walker"), "there is no agent 'walker'; there are planner, random"),
        (("eval", "--agent", "random", "--homes", "val"), "such as val:0-20"),
        (("eval", "--agent", "planner", "--planner", NOWHERE), "thinknav-server serve"),
        (("report", "absent"), "absent is no run"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    process = thinknav(tmp_path, *arguments)
    assert process.returncode == 2
    assert words in one_line(process)


def test_a_baseline_needs_no_service(tmp_path: Path) -> None:
    process = thinknav(
        tmp_path, "train", "--name", "ppo", "--preset", "smoke", "--planner", NOWHERE, "--set", "think.strategy=never"
    )
    assert process.returncode == 0, process.stderr
    made = Checkpoint.load(tmp_path / "runs/ppo/checkpoints/0000000256.pt")
    assert made.action_space == ("stop", "move_forward", "turn_left", "turn_right")
    assert made.embedding_space is None
    assert all(torch.isfinite(weight).all() for weight in made.policy.values())


def test_agents_play_without_a_policy(tmp_path: Path, planning_service: str) -> None:
    few = ("--homes", "val:0-1", "--episodes", "2", "--preset", "smoke")
    process = thinknav(tmp_path, "eval", "--agent", "shortest-path", *few, "--output", "best")
    assert process.returncode == 0, process.stderr
    best = json.loads((tmp_path / "best/result.json").read_text())
    assert best["protocol"] | {"agent": "shortest-path", "privileged": True, "planner": None} == best["protocol"]
    process = thinknav(tmp_path, "eval", "--agent", "planner", *few, "--planner", planning_service, "--context", "3")
    assert process.returncode == 0, process.stderr
    told = json.loads((tmp_path / "runs/evaluations/planner-val_0-1/result.json").read_text())
    assert told["protocol"]["planner"].startswith("scripted@")
    assert told["protocol"]["config"]["think"]["context"] == 3
    assert 0.2 <= told["summary"]["think_rate"]["mean"] <= 0.5


def test_ctrl_c_saves_a_checkpoint_and_resuming_goes_on(tmp_path: Path, planning_service: str) -> None:
    arguments = ("train", "--name", "a", "--preset", "smoke", "--planner", planning_service)
    with started(tmp_path, *arguments, "--set", "total_steps=1000000") as process:
        wait_for(tmp_path / "runs/a/metrics.jsonl", process)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 130, said
    saved = sorted((tmp_path / "runs/a/checkpoints").glob("*.pt"))[-1]
    steps = Checkpoint.load(saved).steps
    assert steps == json.loads((tmp_path / "runs/a/metrics.jsonl").read_text().splitlines()[-1])["steps"] > 0
    more = thinknav(tmp_path, "train", "--name", "a", "--resume", "--set", f"total_steps={steps + 64}")
    assert more.returncode == 0, more.stderr
    assert (tmp_path / f"runs/a/checkpoints/{steps + 64:010d}.pt").exists()


def test_a_service_that_dies_ends_the_run_with_one_line(tmp_path: Path, start_service: StartService) -> None:
    url, service = start_service("--planner", "scripted")
    arguments = ("train", "--name", "a", "--preset", "smoke", "--planner", url)
    endless = ("--set", "total_steps=1000000", "--set", "think.patience=0.5")
    with started(tmp_path, *arguments, *endless) as process:
        wait_for(tmp_path / "runs/a/thoughts.jsonl", process)
        service.kill()
        _, said = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 1, said
    assert "has not answered for" in said
    assert "Traceback" not in said


SMALL_DEMO = ("demo", "--preset", "smoke")


def test_demo_reports_and_leaves_no_process(tmp_path: Path) -> None:
    process = thinknav(tmp_path, *SMALL_DEMO, "--runs", "made-by-the-demo-test")
    assert process.returncode == 0, process.stderr
    page = tmp_path / "made-by-the-demo-test/demo/report.html"
    assert "untrained" in page.read_text()
    assert f"report: {page.relative_to(tmp_path)}" in process.stdout
    assert not processes_of(["thinknav-server", "--until-eof"], tmp_path)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_a_demo_that_is_ended_leaves_no_process(tmp_path: Path, number: signal.Signals, status: int) -> None:
    with started(tmp_path, *SMALL_DEMO, "--set", "total_steps=1000000") as process:
        wait_for(tmp_path / "runs/demo/metrics.jsonl", process)
        assert processes_of(["thinknav-server", "--until-eof"], tmp_path)
        process.send_signal(number)
        _, said = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == status, said
    until = time.monotonic() + 30
    while processes_of(["thinknav-server", "--until-eof"], tmp_path) and time.monotonic() < until:
        time.sleep(0.1)
    assert not processes_of(["thinknav-server", "--until-eof"], tmp_path)
    if number != signal.SIGKILL:
        assert len(list((tmp_path / "runs/demo/checkpoints").glob("*.pt"))) >= 2
