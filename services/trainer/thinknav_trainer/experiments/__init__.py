"""Experiments: some arms, several seeds of each, trained and evaluated in turn, and a table at the end.

`experiment` says what one is, and which there are; `running` does what is still to be done; `table` writes it down.
"""

from thinknav_trainer.experiments.experiment import EXPERIMENTS, Arm, Experiment, named_experiment
from thinknav_trainer.experiments.running import run_experiment
from thinknav_trainer.experiments.table import MEASURES, Outcome, write_table

__all__ = [
    "EXPERIMENTS",
    "MEASURES",
    "Arm",
    "Experiment",
    "Outcome",
    "named_experiment",
    "run_experiment",
    "write_table",
]
