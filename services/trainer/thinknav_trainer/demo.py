"""The whole way in one command: serve, train, evaluate before and after, report.

Starts nothing that it does not stop.
"""

import logging
import shutil
from pathlib import Path

from thinknav_trainer.config import TrainConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.report import write_report
from thinknav_trainer.run import RunError, list_checkpoints
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.service_process import planning_service
from thinknav_trainer.workflow import evaluate_checkpoint, train_run

logger = logging.getLogger(__name__)


def run_demo(folder: Path, config: TrainConfig, interrupted: Interruption) -> Path | None:
    """Returns the report's path; None when the user interrupted, in which case the checkpoint is kept.

    An earlier demo in the folder is replaced.
    """
    if folder.exists():
        if any(folder.iterdir()) and not (folder / "config.yaml").exists():
            raise RunError(f"{folder} is not empty and holds no run; move it away first")
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    with planning_service(folder / "service.log") as url:
        config = config.with_planner(url)
        homes = make_homes(config)
        train_run(folder, config, interrupted, homes=homes)
        checkpoints = list_checkpoints(folder)
        for checkpoint in (checkpoints[0], checkpoints[-1]):
            if not interrupted.requested:
                evaluate_checkpoint(checkpoint, "held_out", interrupted, url, homes=homes)
    return None if interrupted.requested else write_report(folder)
