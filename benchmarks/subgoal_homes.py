"""How much the embedded subgoal VLM gains from more homes: the same number of visits to 10, 40, 160 or ever new ones.

    python benchmarks/subgoal_homes.py --visits 1000 --output runs/subgoal-homes

Asks in validation homes, as `thinknav models evaluate subgoal` does. Prints a Markdown table; Ctrl-C leaves checkpoints
from which the same command goes on. Two cores teach 1,000 visits in some ten minutes.
"""

import argparse
import sys
from pathlib import Path

import torch

from thinknav_trainer.model_training.subgoal_batch import Collator
from thinknav_trainer.model_training.subgoal_evaluation import (
    ANYWHERE,
    UNDER_WAY,
    accuracy_row,
    exam_lessons,
    mark,
)
from thinknav_trainer.model_training.subgoal_training import Schooling, teach

HOMES = (10, 40, 160, 100_000)
EXAM_HOMES = 30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--visits", type=int, default=1000)
    parser.add_argument("--output", type=Path, required=True, help="folder of the checkpoints")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    lessons = [lesson for looks in (ANYWHERE, UNDER_WAY) for lesson in exam_lessons(range(EXAM_HOMES), looks)]
    rows = []
    for homes in HOMES:
        pupil = teach(Schooling(visits=arguments.visits, homes=homes), arguments.output / f"{homes}-homes")
        collate = Collator(pupil.vocabulary)
        for shown, several in (("one frame", False), ("several frames", True)):
            row = accuracy_row(mark(pupil.network, collate, lessons, several=several))
            rows.append((min(homes, arguments.visits // 2), shown, row["way, in view"], row["way, not in view"]))
    sys.stdout.write("| homes | shown | way, in view | way, not in view |\n|---|---|---|---|\n")
    sys.stdout.write("".join(f"| {n} | {shown} | {seen:.3f} | {unseen:.3f} |\n" for n, shown, seen, unseen in rows))


if __name__ == "__main__":
    main()
