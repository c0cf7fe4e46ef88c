"""torchrun starts workers, loses one, and starts them again where they were."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

STEPS = 3_840
TORCHRUN = [
    sys.executable,
    "-m",
    "torch.distributed.run",
    "--standalone",
    "--nproc-per-node",
    "2",
    "--max-restarts",
    "1",
]
OVERRIDES = ("think.strategy=never", f"total_steps={STEPS}", "checkpoint_every=128", "ppo.precision=float32")

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="finds a worker by /proc")


def worker(parent: int, rank: int) -> int:
    """The process that is a worker's, by its rank."""
    for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
        if f"RANK={rank}".encode() in Path(f"/proc/{child}/environ").read_bytes().split(b"\0"):
            return int(child)
    raise AssertionError(f"{parent} has no worker {rank}")


def test_a_killed_worker_is_named_and_the_run_goes_on(tmp_path: Path) -> None:
    command = [
        *TORCHRUN,
        "-m",
        "thinknav_trainer",
        "train",
        "--name",
        "run",
        "--preset",
        "smoke",
        "--runs",
        str(tmp_path),
    ]
    command += [part for override in OVERRIDES for part in ("--set", override)]
    with (tmp_path / "log").open("w") as log:
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        try:
            while not list((tmp_path / "run" / "checkpoints").glob("*[1-9]*.pt")):
                assert process.poll() is None, (tmp_path / "log").read_text()
                time.sleep(0.02)
            os.kill(worker(process.pid, 1), signal.SIGKILL)
            assert process.wait(300) == 0
        finally:
            process.terminate()
    said = (tmp_path / "log").read_text()
    assert said.count("thinknav (worker") == 1, said
    assert "thinknav (worker 0): worker 1 is gone: killed, or cut off" in said
    assert "Traceback" not in said
    steps = [json.loads(line)["steps"] for line in (tmp_path / "run" / "metrics.jsonl").read_text().splitlines()]
    assert steps == list(range(128, STEPS + 1, 128))
