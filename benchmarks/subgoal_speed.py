"""How long the embedded subgoal VLM takes, on one core. Prints a Markdown table.

    python benchmarks/subgoal_speed.py

Times are processor time of the calling thread, the best of many repetitions, so that what else the machine does counts
little.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
import torch

from thinknav_models.subgoal_vlm import MAX_RECENT, Question, SubgoalVLM

REPETITIONS = 40


def milliseconds(work: Callable[[], object]) -> float:
    """The best of REPETITIONS."""
    best = float("inf")
    for _ in range(REPETITIONS):
        start = time.thread_time()
        work()
        best = min(best, time.thread_time() - start)
    return 1e3 * best


def main() -> None:
    torch.set_num_threads(1)
    model, revision = SubgoalVLM.load()
    rng = np.random.default_rng(0)
    rows = []
    for size, count, recent in ((128, 8, 0), (128, 32, 0), (128, 1, 0), (256, 8, 0), (128, 8, MAX_RECENT)):
        frames = rng.integers(0, 256, (count, 1 + recent, size, size, 3), dtype=np.uint8)
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
