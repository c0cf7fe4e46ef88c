"""One job in a process of its own: `python -m thinknav_trainer.experiments.process RUN`.

The folder has `job.json`; the process leaves `line.json` there when the job is done. It ends in good order on SIGTERM,
and when whoever started it is gone: then its standard input ends.
"""

import json
import logging
import os
import signal
import sys
import threading
from pathlib import Path

from thinknav_trainer.experiments.job import Job
from thinknav_trainer.experiments.work import SharedHomes, do_job
from thinknav_trainer.files import replace_text
from thinknav_trainer.interrupt import interruption

JOB, LINE, LOG = "job.json", "line.json", "run.log"


def main(run: Path) -> int:
    """The exit status: 0 done, 128 and the signal's number when it was stopped. What goes wrong is raised."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("httpx").setLevel(logging.WARNING)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with interruption() as interrupted:
        line = do_job(Job.read(run / JOB), run, SharedHomes(), interrupted)
    if line is not None:
        replace_text(run / LINE, json.dumps(line))
    return interrupted.exit_code


def _end_with_parent() -> None:
    while os.read(0, 1):  # not by sys.stdin, whose lock a process that ends could not take from us
        """Nothing is said there; it ends with whoever holds the other end."""
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
