"""Experiments: some arms, several seeds of each, trained and evaluated; a ledger of what came out, a table and figures.

`experiment` says what one is, `named` which there are; `running` does what is still to be done; `pages` writes it down.
"""

from thinknav_trainer.experiments.experiment import AgentRow, Arm, EvaluatedIn, Experiment, Form
from thinknav_trainer.experiments.named import EXPERIMENTS, REPRODUCED, named_experiment
from thinknav_trainer.experiments.running import Done, Wanted, run_experiment, write_results

__all__ = [
    "EXPERIMENTS",
    "REPRODUCED",
    "AgentRow",
    "Arm",
    "Done",
    "EvaluatedIn",
    "Experiment",
    "Form",
    "Wanted",
    "named_experiment",
    "run_experiment",
    "write_results",
]
