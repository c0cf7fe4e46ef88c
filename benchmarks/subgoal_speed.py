"""How long the embedded subgoal VLM takes, on one core. Prints a Markdown table.

    python benchmarks/subgoal_speed.py

Asks about frames of a validation home: how long an answer takes depends on how many words it has. Times are processor
time of the calling thread, the best of many repetitions, so that what else the machine does counts little.
"""

import sys
import time
from collections.abc import Callable
from contextlib import closing

import numpy as np
import torch
from numpy.typing import NDArray

from thinknav_models.subgoal_vlm import MAX_RECENT, Question, SubgoalVLM
from thinknav_sim.render import Camera, make_renderer
from thinknav_trainer.bench.worlds import views_in
from thinknav_trainer.model_training.frames import HomeSource

REPETITIONS = 40


def milliseconds(work: Callable[[], object]) -> float:
    """The best of REPETITIONS."""
    best = float("inf")
    for _ in range(REPETITIONS):
        start = time.thread_time()
        work()
        best = min(best, time.thread_time() - start)
    return 1e3 * best


def frames_of_a_home(count: int, views: int, size: int) -> NDArray[np.uint8]:
    """(count, views, size, size, 3)."""
    home = HomeSource("val").scene(0)
    with closing(make_renderer()) as renderer:
        poses = views_in(home, count * views)
        rgb, _ = renderer.render(np.full(len(poses), renderer.add_scene(home)), poses, Camera(size, size))
        frames: NDArray[np.uint8] = rgb.reshape(count, views, size, size, 3).copy()
    return frames


def main() -> None:
    torch.set_num_threads(1)
    model, revision = SubgoalVLM.load()
    rows = []
    for size, count, recent in ((128, 8, 0), (128, 32, 0), (128, 1, 0), (256, 8, 0), (128, 8, MAX_RECENT)):
        frames = frames_of_a_home(count, 1 + recent, size)
        questions = [
            Question(views[0], "chair", tuple((view, 0.5) for view in views[1:]), temperature=1.0) for views in frames
        ]
        taken = milliseconds(lambda questions=questions: model.answer(questions))  # type: ignore[misc]
        shown = f"{size} x {size}" + (f" and {recent} earlier ones" if recent else "")
        rows.append((f"a subgoal, {count} at once, a frame of {shown}", taken / count))
    rows.append(("loading", milliseconds(SubgoalVLM.load)))
    sys.stdout.write(f"subgoal-vlm@{revision}\n\n| | ms |\n|---|---|\n")
    sys.stdout.write("".join(f"| {name} | {taken:.2f} |\n" for name, taken in rows))


if __name__ == "__main__":
    main()
