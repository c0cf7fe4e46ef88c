"""Does what an experiment still lacks, keeps each outcome in its ledger, and writes down what there is.

Knows jobs and lines; nothing of what the arms mean.
"""

import logging
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from thinknav_trainer.experiments.experiment import Experiment
from thinknav_trainer.experiments.job import Job, jobs_of
from thinknav_trainer.experiments.ledger import Ledger, Line
from thinknav_trainer.experiments.pages import write_pages
from thinknav_trainer.experiments.process import LOG
from thinknav_trainer.experiments.side_by_side import Failure, do_side_by_side
from thinknav_trainer.experiments.work import SharedHomes, do_job
from thinknav_trainer.interrupt import Interruption

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Wanted:
    """What is to be done of an experiment.

    arms: some of them, all unless said. seeds: none: as many as each arm has. What is written down is of all arms,
    and of all seeds that there are. jobs: how many at a time. overrides: over those of every arm.
    """

    arms: tuple[str, ...] = ()
    seeds: int | None = None
    jobs: int = 1
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class Done:
    """page: the table, none where there is nothing to put into it. failures: what could not be done."""

    page: Path | None
    failures: list[Failure] = field(default_factory=list)


def run_experiment(
    experiment: Experiment, runs: Path, results: Path, interrupted: Interruption, wanted: Wanted = Wanted()
) -> Done:
    """Do all jobs that have no line in the ledger yet, then write table and figures of all that are done.

    runs: the folder of this experiment's runs. results: that of its ledger, table and figures. When the user
    interrupts, the same call goes on later. Raises ConfigError before anything is done.
    """
    experiment = replace(experiment, changed=wanted.overrides)
    jobs = jobs_of(experiment.with_arms(wanted.arms) if wanted.arms else experiment, wanted.seeds)
    ledger = Ledger(results, experiment.full_name)
    missing = [job for job in jobs if ledger.find(job) is None]
    logger.info("%s: %d of %d jobs are done", experiment.full_name, len(jobs) - len(missing), len(jobs))

    def note(job: Job, line: Line) -> None:
        ledger.add(line)
        logger.info("%s, seed %d: success %.3f, SPL %.3f", job.arm, job.seed, *_told(line))

    if wanted.jobs > 1:
        failures = do_side_by_side(missing, runs, wanted.jobs, interrupted, note)
    else:
        failures = _do_in_turn(missing, runs, interrupted, note)
    return Done(write_results(experiment, results, wanted), failures)


def write_results(experiment: Experiment, results: Path, wanted: Wanted = Wanted()) -> Path | None:
    """Table and figures of what the ledger has, in its folder; the path of the table, none of an empty ledger."""
    experiment = replace(experiment, changed=wanted.overrides)
    ledger = Ledger(results, experiment.full_name)
    usual, more = (jobs_of(experiment, seeds) for seeds in (None, ledger.most_seeds))
    lines = ledger.lines_of({job.key: job for job in (*usual, *more)}.values())
    return write_pages(experiment, lines, results) if lines else None


def _do_in_turn(
    jobs: Sequence[Job], folder: Path, interrupted: Interruption, done: Callable[[Job, Line], None]
) -> list[Failure]:
    """As `do_side_by_side`, one after another in our own process."""
    homes = SharedHomes()
    failures: list[Failure] = []
    for job in jobs:
        run = folder / job.name
        try:
            line = do_job(job, run, homes, interrupted)
        except Exception as error:  # whatever became of one, the others are done
            run.mkdir(parents=True, exist_ok=True)
            with (run / LOG).open("a") as log:
                log.write(traceback.format_exc())
            failures.append(Failure(job, f"{type(error).__name__}: {error}", run / LOG))
            logger.exception("%s, seed %d failed", job.arm, job.seed)
            continue
        if interrupted.requested or line is None:
            break
        done(job, line)
    return failures


def _told(line: Line) -> tuple[float, float]:
    return line["measures"]["success"], line["measures"]["spl"]
