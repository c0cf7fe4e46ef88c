"""A piece of an experiment's work: one seed of an arm, or an agent without training; and which there are, in order."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from thinknav_trainer.config import TrainConfig, WorkersConfig, parse_config
from thinknav_trainer.experiments.experiment import EvaluatedIn, Experiment


@dataclass(frozen=True)
class Job:
    """agent: plays instead of a policy that is trained; none: train. arm: the name of the arm or the row."""

    experiment: str
    arm: str
    seed: int
    config: TrainConfig
    evaluated_in: EvaluatedIn | None = None
    agent: str | None = None

    @property
    def digest(self) -> str:
        """Of all that its outcome depends on and that differs from the defaults, so that a key that ThinkNav learns
        later makes no job another one."""
        where = None if self.evaluated_in is None else asdict(self.evaluated_in)
        parts = [
            without_machine(self.config).model_dump_json(exclude_defaults=True),
            json.dumps(where),
            str(self.agent),
        ]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:10]

    @property
    def key(self) -> tuple[str, int, str]:
        """What a ledger knows it by."""
        return (self.arm, self.seed, self.digest)

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{self.arm}-{self.seed}-{self.digest}"

    def write(self, path: Path) -> None:
        """For another process."""
        values = {**vars(self), "config": self.config.model_dump(mode="json")}
        values["evaluated_in"] = None if self.evaluated_in is None else asdict(self.evaluated_in)
        path.write_text(json.dumps(values))

    @classmethod
    def read(cls, path: Path) -> "Job":
        """What `write` wrote."""
        values: dict[str, Any] = json.loads(path.read_text())
        where = values["evaluated_in"]
        values["evaluated_in"] = None if where is None else EvaluatedIn(**where)
        return cls(**{**values, "config": parse_config(values["config"])})


def without_machine(config: TrainConfig) -> TrainConfig:
    """A configuration without what depends on where it runs: the same run on a larger machine is the same run."""
    return config.model_copy(update={"threads": 0, "workers": WorkersConfig(), "keep_checkpoints": 3})


def jobs_of(experiment: Experiment, seeds: int | None = None) -> list[Job]:
    """All of an experiment: the rows, then one seed of each arm, then the next. Raises ConfigError."""
    name, where = experiment.full_name, experiment.evaluated_in
    rows = [Job(name, row.name, 0, experiment.config(row, 0), where, row.agent) for row in experiment.rows]
    most = max((experiment.seeds_of(arm, seeds) for arm in experiment.arms), default=0)
    runs = [
        Job(name, arm.name, seed, experiment.config(arm, seed), where)
        for seed in range(most)
        for arm in experiment.arms
        if seed < experiment.seeds_of(arm, seeds)
    ]
    return rows + runs
