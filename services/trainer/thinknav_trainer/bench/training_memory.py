"""Training for a long time, to see that memory does not grow: a whole run, with logs, thoughts and checkpoints."""

import json
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

from thinknav_trainer.bench.memory import resident_mb
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.service_process import planning_service
from thinknav_trainer.train import train
from thinknav_trainer.workflow import connect_if_thinking


@dataclass(frozen=True)
class TrainingSample:
    """Resident memory of the trainer's process: environment steps and seconds since the start, megabytes."""

    steps: int
    seconds: float
    megabytes: float

    @property
    def line(self) -> str:
        """The sample as one line of JSON."""
        return json.dumps(asdict(self))


class WatchedRun(Run):
    """A run that takes a sample of memory every so many steps, with the line of the log that is due then."""

    def watch(self, every: int, tell: Callable[[TrainingSample], None]) -> None:
        """tell: who gets each sample as soon as it is taken."""
        self._every, self._tell = every, tell
        self._due, self._start = every, time.monotonic()

    def log(self, steps: int, metrics: Mapping[str, float], timing: Mapping[str, float]) -> None:
        super().log(steps, metrics, timing)
        if steps >= self._due:
            self._due = steps + self._every
            self._tell(TrainingSample(steps, round(time.monotonic() - self._start, 1), round(resident_mb(), 1)))


def watch_training(
    config: TrainConfig, every: int, tell: Callable[[TrainingSample], None], interruption: Interruption
) -> None:
    """Train for `config.total_steps` in a folder that is gone afterwards, and take a sample every so many steps.

    Where the policy thinks and the configuration names no other planner, the embedded one answers in a process of its
    own.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if config.think.strategy != "never" and config.planner == TrainConfig().planner:
            config = config.with_planner(stack.enter_context(planning_service(folder / "service.log")))
        planner = connect_if_thinking(config, stack)
        run = WatchedRun.create(folder / "run", config)
        stack.callback(run.close)
        run.watch(every, tell)
        train(run, make_homes(config), planner, interruption)
