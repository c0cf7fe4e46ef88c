"""Does a job: trains what is still to be trained, evaluates it, and says in one line what came out.

A run's folder keeps all of it: what was begun goes on, what was evaluated is not evaluated again. A policy that thinks
is also evaluated on the same episodes with its thoughts masked and with another agent's (`control`).
"""

import logging
import time
from collections.abc import Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from statistics import fmean
from typing import Any

from thinknav_trainer.config import ConfigError, TrainConfig
from thinknav_trainer.episode_sets import EpisodeSet, of_homes
from thinknav_trainer.evaluate_agent import Setting, named_agent, play_agent
from thinknav_trainer.experiments.downsample import learning_curve, rounded
from thinknav_trainer.experiments.job import Job, without_machine
from thinknav_trainer.experiments.ledger import Line, whose_code
from thinknav_trainer.home_sets import parse_home_set
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.records import EpisodeRecord, read_evaluation, write_evaluation
from thinknav_trainer.run import list_checkpoints, read_config, read_log, read_metrics
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.workflow import connect_if_thinking, evaluate_checkpoint, train_run

logger = logging.getLogger(__name__)

MEASURES = (
    "success",
    "spl",
    "soft_spl",
    "distance_to_goal",
    "sot",
    "steps",
    "thinks",
    "think_rate",
    "think_loops",
    "spinning",
    "agreement_share",
)
# Evaluated once more, with its thoughts replaced: by name in a line, the control.
REPLACED = {"masked": "zeros", "shuffled": "another"}

Records = list[EpisodeRecord]


class SharedHomes:
    """Homes and episodes, made once for all jobs of a process that play in the same ones."""

    def __init__(self) -> None:
        self._made: dict[str, Homes] = {}
        self._elsewhere: dict[str, EpisodeSet] = {}

    def of(self, config: TrainConfig) -> Homes:
        """Those of a configuration."""
        key = config.scenes.model_dump_json() + config.env.model_dump_json()
        if key not in self._made:
            self._made[key] = make_homes(config)
        return self._made[key]

    def elsewhere(self, job: Job) -> EpisodeSet | None:
        """The episodes that a job is evaluated on, if they are not its run's held-out ones."""
        if job.evaluated_in is None:
            return None
        key = f"{job.evaluated_in} {job.config.env.model_dump_json()}"
        if key not in self._elsewhere:
            wanted = job.evaluated_in
            self._elsewhere[key] = of_homes(parse_home_set(wanted.homes), wanted.episodes, job.config.env)
        return self._elsewhere[key]


def do_job(job: Job, run: Path, homes: SharedHomes, interrupted: Interruption) -> Line | None:
    """The line of a job, its files in the folder `run`; None when the user interrupted, after which the same call goes
    on. Raises what training and evaluating do.
    """
    found = _play_agent(job, run, homes, interrupted) if job.agent else _trained(job, run, homes, interrupted)
    if interrupted.requested or found is None:
        return None
    return {
        "experiment": job.experiment,
        "arm": job.arm,
        "seed": job.seed,
        "digest": job.digest,
        "agent": job.agent,
        **whose_code(),
        "finished": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "config": without_machine(job.config).model_dump(mode="json", exclude_defaults=True),
        **found,
    }


def _play_agent(job: Job, run: Path, homes: SharedHomes, interrupted: Interruption) -> Line | None:
    began = time.perf_counter()
    episodes = homes.elsewhere(job)
    if episodes is None:
        own = homes.of(job.config)
        episodes = EpisodeSet("held_out", own.scenes, own.held_out)
    with ExitStack() as stack:
        thinks = named_agent(str(job.agent)).thinks
        planner = connect_if_thinking(job.config, stack) if thinks else None
        protocol, records = play_agent(str(job.agent), episodes, Setting(job.config), planner, interrupted)
    if interrupted.requested:
        return None
    write_evaluation(run / "evaluation", protocol, records)
    return {**_facts(protocol, records), "wall_seconds": round(time.perf_counter() - began)}


def _trained(job: Job, run: Path, homes: SharedHomes, interrupted: Interruption) -> Line | None:
    begun = (run / "config.yaml").exists()
    if begun and without_machine(read_config(run)) != without_machine(job.config):
        raise ConfigError(f"{run} was made with other defaults than today's; move it away, or give another --runs")
    if _evaluation(run / "evaluation") is None:
        logger.info("%s is to be trained and evaluated", run)
        train_run(run, job.config, interrupted, resume=begun, homes=homes.of(job.config))
    began = time.perf_counter()
    controls = REPLACED if hears_its_planner(job.config) else {}
    found = {
        name: _evaluated(job, run, name, homes, interrupted, control)
        for name, control in {"evaluation": None, **controls}.items()
    }
    if interrupted.requested:
        return None
    protocol, records = found.pop("evaluation")
    replaced = {name: measures_of(found[name][1]) if name in found else None for name in REPLACED}
    curve = learning_curve(read_metrics(run))
    seconds = round(_seconds_of_training(run) + time.perf_counter() - began)
    return {**_facts(protocol, records), **replaced, "curve": curve, "wall_seconds": seconds}


def hears_its_planner(config: TrainConfig) -> bool:
    """Whether there are thoughts to replace."""
    return config.think.strategy != "never" and config.planner.control == "none"


def _evaluated(
    job: Job, run: Path, name: str, homes: SharedHomes, interrupted: Interruption, control: str | None
) -> tuple[dict[str, Any], Records]:
    """Protocol and records of the last policy's evaluation in the folder `name` of its run, made unless it is there."""
    if not interrupted.requested and _evaluation(run / name) is None:
        last = list_checkpoints(run)[-1]
        elsewhere = homes.elsewhere(job)
        evaluate_checkpoint(
            last,
            "held_out",
            interrupted,
            output=run / name,
            homes=None if elsewhere else homes.of(job.config),
            elsewhere=elsewhere,
            control=control,
        )
    return _evaluation(run / name) or ({}, [])


def _evaluation(folder: Path) -> tuple[dict[str, Any], Records] | None:
    try:
        result, records = read_evaluation(folder)
    except ConfigError:
        return None
    return result["protocol"], records


def _facts(protocol: dict[str, Any], records: Records) -> Line:
    return {
        "planner": protocol["planner"],
        "privileged": protocol["privileged"],
        "split": protocol["split"],
        "episodes": len(records),
        "scenes": sorted({record.scene for record in records}),
        "measures": measures_of(records),
    }


def measures_of(records: Sequence[EpisodeRecord]) -> dict[str, float | None]:
    """Means over episodes; `calls_per_success` is all thinks over all successes, None without any of those."""
    means: dict[str, float | None] = {
        name: rounded(fmean(record.measures[name] for record in records)) for name in MEASURES
    }
    successes = sum(record.measures["success"] for record in records)
    thinks = sum(record.measures["thinks"] for record in records)
    means["calls_per_success"] = rounded(thinks / successes) if successes else None
    for term in records[0].terms:
        means[f"reward/{term}"] = rounded(fmean(record.terms[term] for record in records))
    return means


def _seconds_of_training(run: Path) -> float:
    """Of all updates that are part of a run, however often it was interrupted."""
    rows = read_log(run / "timing.jsonl")
    return float(sum(value for row in rows for name, value in row.items() if name.startswith("time/")))
