"""Trains and evaluates what an experiment still lacks.

A run lies in a folder that is named after its arm, its seed and a hash of its configuration: what was done with the
same configuration is not done again, and what was begun goes on. Knows nothing of what the arms mean.
"""

import hashlib
import logging
from collections.abc import Sequence
from pathlib import Path

from thinknav_trainer.config import ConfigError, TrainConfig
from thinknav_trainer.experiments.experiment import Experiment
from thinknav_trainer.experiments.table import Outcome, write_table
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.records import EpisodeRecord, read_evaluation
from thinknav_trainer.run import read_config
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.workflow import evaluate_checkpoint, train_run

logger = logging.getLogger(__name__)


def run_experiment(
    experiment: Experiment,
    folder: Path,
    seeds: int,
    interrupted: Interruption,
    overrides: Sequence[str] = (),
    smoke: bool = False,
) -> Path | None:
    """The page with the table; None when the user interrupted, after which the same call goes on.

    One seed of each arm, then the next one. The table is written anew when all arms have a seed more.
    """
    page = None
    homes = SharedHomes()
    outcomes: list[Outcome] = []
    for seed in range(seeds):
        for arm in experiment.arms:
            config = experiment.config(arm, seed, overrides, smoke)
            run = folder / f"{arm.name}-{seed}-{_digest(config)}"
            records = _trained_and_evaluated(run, config, homes, interrupted)
            if interrupted.requested:
                return None
            outcomes.append(Outcome(arm.name, seed, config, records))
        page = write_table(folder, experiment, outcomes)
    return page


class SharedHomes:
    """Homes and episodes, made once for all runs that play in the same ones."""

    def __init__(self) -> None:
        self._made: dict[str, Homes] = {}

    def of(self, config: TrainConfig) -> Homes:
        """Those of a configuration."""
        key = config.scenes.model_dump_json() + config.env.model_dump_json()
        if key not in self._made:
            self._made[key] = make_homes(config)
        return self._made[key]


def _trained_and_evaluated(
    run: Path, config: TrainConfig, homes: SharedHomes, interrupted: Interruption
) -> list[EpisodeRecord]:
    """The records of a run's held-out episodes; none when the user interrupts."""
    begun = (run / "config.yaml").exists()
    if begun and read_config(run) != config:
        raise ConfigError(f"{run} was made with other defaults than today's; move it away, or give another --runs")
    try:
        return read_evaluation(run / "evaluation")[1]
    except ConfigError:
        logger.info("%s is to be trained and evaluated", run)
    own = homes.of(config)
    checkpoint = train_run(run, config, interrupted, resume=begun, homes=own)
    if interrupted.requested:
        return []
    return evaluate_checkpoint(checkpoint, "held_out", interrupted, output=run / "evaluation", homes=own)[1]


def _digest(config: TrainConfig) -> str:
    """Of what differs from the defaults, so that a key that ThinkNav learns later makes no run another one."""
    return hashlib.sha256(config.model_dump_json(exclude_defaults=True).encode()).hexdigest()[:10]
