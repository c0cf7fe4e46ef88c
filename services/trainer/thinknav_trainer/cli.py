"""The `thinknav` command. Finds the command that is called, turns errors into one line and an exit status.

Exit status: 0 done, 1 failed, 2 something the user gave cannot be used, 130 Ctrl-C.
"""

import logging
import sys

from rich.console import Console
from rich.logging import RichHandler

from thinknav_trainer.errors import exit_status, file_problem
from thinknav_trainer.lazy_commands import Lazy, lazy_app
from thinknav_trainer.torchrun_environment import own_rank, started_by_torchrun

_COMMANDS = "thinknav_trainer.commands"

# In the list of `thinknav --help`, in this order; each command's own help says more.
COMMANDS = {
    "demo": Lazy("See all of it in minutes: a planning service, a training, a report.", f"{_COMMANDS}.demo:demo"),
    "train": Lazy("Train a policy.", f"{_COMMANDS}.train:train"),
    "eval": Lazy("Play episodes with a policy or a named agent.", f"{_COMMANDS}.evaluate:evaluate"),
    "compare": Lazy("Compare evaluations of the same episodes.", f"{_COMMANDS}.compare:compare_runs"),
    "budgets": Lazy("SPL against calls of the planner.", f"{_COMMANDS}.budgets:budgets"),
    "report": Lazy("Write a run's report.html.", f"{_COMMANDS}.report:report"),
    "experiment": Lazy("Train and evaluate the arms of an experiment.", f"{_COMMANDS}.experiment:experiment"),
    "reproduce": Lazy("Reproduce the paper: single, five, unseen.", f"{_COMMANDS}.experiment:reproduce"),
    "ask": Lazy("Ask the embedded planner about a picture.", f"{_COMMANDS}.ask:ask"),
    "homes": Lazy("Look at procedural homes.", f"{_COMMANDS}.homes:app"),
    "scenes": Lazy("Scans of real homes: GLB, OBJ, PLY, HM3D folders.", f"{_COMMANDS}.scenes:app"),
    "episodes": Lazy("Make and check files of episodes, in Habitat's format.", f"{_COMMANDS}.episodes:app"),
    "models": Lazy("The small networks that ThinkNav ships: make, measure.", f"{_COMMANDS}.models:app"),
    "bench": Lazy("Measure speed and memory on this machine.", f"{_COMMANDS}.bench:app"),
    "redo": Lazy("Go once more through why a run stopped.", f"{_COMMANDS}.redo:redo"),
}

app = lazy_app(
    COMMANDS,
    help="Robots that find objects in homes, and ask for a hint when a hint is worth its cost.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Entry point of the command: errors become one line on stderr."""
    console = Console(stderr=True)
    if console.is_terminal:
        logging.basicConfig(
            level=logging.INFO, format="%(message)s", handlers=[RichHandler(console=console, show_path=False)]
        )
    else:
        logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("httpx").setLevel(logging.WARNING)
    if own_rank() > 0:  # what the first worker says is true of the others as well, but for how they fail
        logging.getLogger().setLevel(logging.ERROR)
    try:
        app()
    except Exception as error:
        status = exit_status(error)
        if status is None:
            raise
        _fail(error, status)
    except KeyboardInterrupt:
        _fail(KeyboardInterrupt("interrupted"), 130)


def _fail(error: BaseException, status: int) -> None:
    speaker = f"thinknav (worker {own_rank()})" if started_by_torchrun() else "thinknav"
    sys.stderr.write(f"{speaker}: {file_problem(error) or error}\n")
    sys.exit(status)
