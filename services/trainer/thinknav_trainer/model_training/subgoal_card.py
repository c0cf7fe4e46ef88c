"""The model card of a subgoal VLM: what it is, what it was taught, what it knows and what not."""

from collections.abc import Mapping, Sequence

from thinknav_trainer.model_training.lessons import GOALS_ASKED, VISITS
from thinknav_trainer.model_training.subgoal_evaluation import Exam, Marks, accuracy_row, calibration, stop_marks
from thinknav_trainer.model_training.subgoal_training import Schooling

CARD = """\
# subgoal-vlm@{revision}

A frame, or a frame and up to four earlier ones with their headings, and a goal in; a subgoal out, word by word ("turn
left toward the doorway"), with its confidence. The embedded planner of ThinkNav: it needs no download and no GPU.
{megabytes:.1f} MB, half precision.

## Taught

{visits:,} visits to {taught_in}, some 110 looks a visit, {goals} goals a
look; half of the looks without earlier views. The teacher knows the map. The stop gate was set in {gate_in}.

    {command}

## Known, in {asked_in}

Share of directions that are right. *way*: left, right or forward, where the right answer is not `stop`. In view: the
goal fills at least .3 % of the picture. Controls: what can be won without looking, or without being asked. *Bearing
known*: what going straight for a goal in view would get, for one who knows exactly where it is and nothing of what
stands in between.

At poses anywhere ({anywhere:,} questions):

{anywhere_table}

On routes to the goal and near it, as an agent asks ({under_way:,} questions):

{under_way_table}

`stop` is said from a probability of {gate:.2f} on:

{stop_table}

Confidence of the likeliest direction, and how often it is right (under way, several frames):

{calibration_table}

## Limits

It knows the things and rooms of procedural homes, drawn in plain colours, seen from 0.88 m with 79 degrees. One frame
seldom shows where a goal out of view is: then it says what such homes are like. Earlier views carry a heading and no
place. It reads the six goals and little else. It was made to steer a robot in simulation: do not trust it with a robot
among people.

Licence: Apache-2.0, as the rest of ThinkNav.
"""

_HEAD = "| shown | control | all | all, in view | all, not in view | way, in view | way, not in view |"


def model_card(
    revision: str,
    size: int,
    schooling: Schooling,
    command: str,
    exam: Exam,
    gate: float,
    scans: Sequence[str] = (),
) -> str:
    """The card. size: of the weights in bytes. scans: names of those that it was taught and examined in, if any."""
    homes = min(schooling.homes, schooling.visits // VISITS)
    return CARD.format(
        revision=revision,
        megabytes=size / 1e6,
        visits=schooling.visits,
        taught_in=", ".join(scans) or f"{homes:,} procedural homes of the planner-training seeds",
        gate_in="the same scans" if scans else "other homes of these seeds",
        asked_in="the scans that it was taught in" if scans else "validation homes never seen",
        goals=GOALS_ASKED,
        command=command,
        anywhere=len(exam.anywhere["either", "majority"].right),
        anywhere_table=accuracy_table(exam.anywhere),
        under_way=len(exam.under_way["either", "majority"].right),
        under_way_table=accuracy_table(exam.under_way),
        gate=gate,
        stop_table=stop_table(exam, gate),
        calibration_table=calibration_table(exam.under_way["several frames", "none"]),
    )


def accuracy_table(marks: Mapping[tuple[str, str], Marks]) -> str:
    """A row of Markdown for each control."""
    rows = [_HEAD, "|---" * 7 + "|"]
    for (shown, control), each in marks.items():
        cells = " | ".join(f"{value:.3f}" for value in accuracy_row(each).values())
        rows.append(f"| {shown} | {control} | {cells} |")
    return "\n".join(rows)


def stop_table(exam: Exam, gate: float) -> str:
    """Precision, recall and false stops at the gate."""
    rows = ["| where | shown | precision | recall | false stops, of all looks |", "|---|---|---|---|---|"]
    for where, marks in (("anywhere", exam.anywhere), ("under way", exam.under_way)):
        for shown in ("one frame", "several frames"):
            at_gate = stop_marks(marks[shown, "none"], gate)
            rows.append(
                f"| {where} | {shown} | {at_gate.precision:.2f} | {at_gate.recall:.2f} | {at_gate.false_rate:.2%} |"
            )
    return "\n".join(rows)


def calibration_table(marks: Marks) -> str:
    """Mean confidence, share right and how many, by tenths of confidence."""
    rows = ["| confidence | right | questions |", "|---|---|---|"]
    rows += [f"| {confidence:.2f} | {right:.2f} | {count:,} |" for confidence, right, count in calibration(marks)]
    return "\n".join(rows)
