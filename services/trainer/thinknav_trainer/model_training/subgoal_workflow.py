"""What `thinknav models train subgoal` and `evaluate subgoal` do: teach, set the gate, save, examine, describe."""

from collections.abc import Sequence
from pathlib import Path

from thinknav_models.subgoal_vlm import load_network, save
from thinknav_sim.render import make_renderer
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.frames import HomeSource, ScanSource, SceneSource
from thinknav_trainer.model_training.subgoal_batch import Collator
from thinknav_trainer.model_training.subgoal_card import model_card
from thinknav_trainer.model_training.subgoal_evaluation import (
    ANYWHERE,
    UNDER_WAY,
    Exam,
    all_marks,
    exam_lessons,
    gate_for_false_stops,
    joined,
    mark,
)
from thinknav_trainer.model_training.subgoal_training import Pupil, Schooling, teach
from thinknav_trainer.model_training.teacher import HomeTeacher

WEIGHTS_NAME = "subgoal_vlm.safetensors"
CARD_NAME = "subgoal_vlm.md"
EXAM_HOMES = 60
GATE_HOMES = 40
FALSE_STOPS = 0.003  # of all looks: what the gate must keep to

# Homes for setting the gate lie far behind those that are taught in, and are no validation homes.
_FIRST_GATE_HOME = 900_000


def train_and_describe(
    output: Path,
    schooling: Schooling,
    scans: Sequence[Path],
    command: str,
    interruption: Interruption,
    gate_homes: int = GATE_HOMES,
    exam_homes: int = EXAM_HOMES,
) -> Path | None:
    """Teach, or go on teaching, write weights and card into a folder; the path of the weights, None if interrupted.

    Raises SchoolingError, SceneError.
    """
    source: SceneSource = ScanSource(tuple(scans)) if scans else HomeSource("planner")
    for number in range(len(scans)):  # here and now, not in the middle of the teaching
        HomeTeacher(source.scene(number), make_renderer(), ObjectNavConfig())
    pupil = teach(schooling, output / "subgoal-training", source=source, interruption=interruption)
    if interruption.requested:
        return None
    path = output / WEIGHTS_NAME
    revision = save_pupil(pupil, path, scans, gate_homes)
    exam, gate = examine(path, exam_homes, scans), load_network(path).stop_gate
    names = [scan.name for scan in scans]
    card = model_card(revision, path.stat().st_size, schooling, command, exam, gate, names)
    (output / CARD_NAME).write_text(card)
    return path


def save_pupil(pupil: Pupil, path: Path, scans: Sequence[Path] = (), gate_homes: int = GATE_HOMES) -> str:
    """Set the gate on `stop`, and write the weights; their revision."""
    source: SceneSource = ScanSource(tuple(scans)) if scans else HomeSource("planner", _FIRST_GATE_HOME)
    homes = range(len(scans) or gate_homes)
    lessons = exam_lessons(homes, ANYWHERE, source) + exam_lessons(homes, UNDER_WAY, source)
    collate = Collator(pupil.vocabulary)
    marks = joined([mark(pupil.network, collate, lessons, several=several) for several in (False, True)])
    path.parent.mkdir(parents=True, exist_ok=True)
    gate = gate_for_false_stops(marks, FALSE_STOPS)
    return save(path, pupil.vocabulary, pupil.network, gate, visits=pupil.schooling.visits, homes=pupil.schooling.homes)


def examine(path: Path, homes: int = EXAM_HOMES, scans: Sequence[Path] = ()) -> Exam:
    """Examine the model in a file in validation homes, or in scans. Raises WeightsError, SceneError."""
    taught = load_network(path)
    collate = Collator(taught.vocabulary)
    source: SceneSource = ScanSource(tuple(scans)) if scans else HomeSource("val")
    first, second = (2 * [range(len(scans))]) if scans else (range(homes // 2), range(homes // 2, homes))
    return Exam(
        all_marks(taught.network, collate, exam_lessons(first, ANYWHERE, source)),
        all_marks(taught.network, collate, exam_lessons(second, UNDER_WAY, source)),
    )
