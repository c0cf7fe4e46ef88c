"""Jobs side by side, each in a process of its own with one thread: on few cores that gives the most steps in all.

A job that fails leaves the others alone. Knows processes and folders; nothing of what a job does.
"""

import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from thinknav_trainer.experiments.job import Job
from thinknav_trainer.experiments.ledger import Line
from thinknav_trainer.experiments.process import JOB, LINE, LOG
from thinknav_trainer.interrupt import Interruption

logger = logging.getLogger(__name__)

LOOK_EVERY_S = 0.2
STOP_TIMEOUT_S = 300.0  # an update, or the rest of an evaluation's round, and a checkpoint
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


@dataclass(frozen=True)
class Failure:
    """A job that could not be done, the last words of it, and where the rest of them is."""

    job: Job
    words: str
    log: Path


@dataclass(frozen=True)
class _Running:
    job: Job
    run: Path
    process: subprocess.Popen[bytes]


def do_side_by_side(
    jobs: Sequence[Job], folder: Path, count: int, interrupted: Interruption, done: Callable[[Job, Line], None]
) -> list[Failure]:
    """Do jobs in their order, `count` at a time; those that failed.

    folder: where each has its own. done: told of each line as it comes. An interruption stops all in good order.
    """
    waiting, running, failures = list(jobs), list[_Running](), list[Failure]()
    try:
        while (waiting and not interrupted.requested) or running:
            while waiting and len(running) < count and not interrupted.requested:
                running.append(_start(waiting.pop(0), folder))
            time.sleep(LOOK_EVERY_S)
            if interrupted.requested:
                _stop(running)
            for ended in [one for one in running if one.process.poll() is not None]:
                running.remove(ended)
                _take(ended, interrupted, failures, done)
    finally:
        for one in running:  # only an exception leads here with any
            one.process.kill()
            one.process.wait()
    return failures


def _start(job: Job, folder: Path) -> _Running:
    run = folder / job.name
    run.mkdir(parents=True, exist_ok=True)
    (run / LINE).unlink(missing_ok=True)
    replace(job, config=job.config.model_copy(update={"threads": 1})).write(run / JOB)
    command = [sys.executable, "-m", "thinknav_trainer.experiments.process", str(run)]
    logger.info("%s, seed %d begins (%s)", job.arm, job.seed, run / LOG)
    with (run / LOG).open("ab") as log:
        # A session of its own, so that Ctrl-C in the terminal reaches us alone, who stop it in good order.
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=os.environ | _ONE_THREAD,
            start_new_session=True,
        )
    return _Running(job, run, process)


def _stop(running: Sequence[_Running]) -> None:
    """Ask all to stop, and wait until they have."""
    for one in running:
        one.process.terminate()
    deadline = time.monotonic() + STOP_TIMEOUT_S
    for one in running:
        try:
            one.process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            logger.warning("%s, seed %d did not stop within %.0f s", one.job.arm, one.job.seed, STOP_TIMEOUT_S)
            one.process.kill()
            one.process.wait()


def _take(
    ended: _Running, interrupted: Interruption, failures: list[Failure], done: Callable[[Job, Line], None]
) -> None:
    """What a process left."""
    if ended.process.stdin is not None:
        ended.process.stdin.close()
    if (ended.run / LINE).exists():
        done(ended.job, json.loads((ended.run / LINE).read_text()))
    elif not interrupted.requested:
        failures.append(Failure(ended.job, _last_words(ended.run / LOG), ended.run / LOG))
        logger.error("%s, seed %d failed: %s", ended.job.arm, ended.job.seed, failures[-1].words)


def _last_words(log: Path) -> str:
    words = log.read_text(errors="replace").strip().splitlines()
    return words[-1] if words else "it said nothing"
