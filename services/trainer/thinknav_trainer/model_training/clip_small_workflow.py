"""What `thinknav models train clip-small` and `evaluate clip-small` do: teach, save, measure, write the card."""

from pathlib import Path

from thinknav_models.clip import ClipTextEncoder
from thinknav_models.clip.image import SMALL_WEIGHTS, ClipImageEncoder
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.clip_card import table
from thinknav_trainer.model_training.clip_evaluate import FRAMES, Measure, evaluate_clip, evaluation_frames
from thinknav_trainer.model_training.clip_small import SMALL_SIZE, SmallTraining, train_small
from thinknav_trainer.model_training.clip_workflow import EVALUATION_HOMES, evaluation_plan
from thinknav_trainer.model_training.frames import FramePlan, HomeSource

CARD = """\
# The small image encoder, clip-small@{revision}

A pupil of {space}: it sees frames of 64 x 64 pixels and gives the features that the CLIP's
image half gives of the same views in 128 x 128, for the same projection into the same space. {megabytes:.1f} MB, half
precision. It is the eye of policies on a CPU (`policy.image_encoder: clip-small`).

## Made of

{frames:,} frames of {homes:,} procedural homes of the planner-training seeds, each drawn in both sizes, and the CLIP's
features of the larger one. The loss is the squared error; {batches} batches of {batch_size}; no sentences, no labels.

    {command}

## Measured

On {measured} frames of {evaluation_homes} validation homes, never seen in training, drawn in 64 x 64; the same poses
and kinds of sentences as in the CLIP's own card. Intervals: 95 %, bootstrap over frames.

{table}

## Limits

Those of its teacher, and half the sharpness: what is far away or small it sees worse.

Licence: Apache-2.0, as the rest of ThinkNav.
"""


def train_and_describe(
    output: Path,
    checkpoints: Path,
    training: SmallTraining,
    command: str,
    interruption: Interruption,
    seed: int = 0,
    evaluation_homes: int = EVALUATION_HOMES,
) -> Path | None:
    """Teach it, or go on, write weights and card into a folder; the path of the weights, None if interrupted."""
    plan = FramePlan(HomeSource("planner"), ObjectNavConfig(), seed, mirror=False)
    tower = train_small(plan, training, checkpoints, interruption)
    if interruption.requested:
        return None
    output.mkdir(parents=True, exist_ok=True)
    path = output / SMALL_WEIGHTS.name
    revision = tower.save(path)
    batch_size = plan.scenes_per_batch * plan.frames_per_scene
    card = CARD.format(
        revision=revision,
        space=ClipImageEncoder.load().space,
        megabytes=path.stat().st_size / 1e6,
        frames=training.batches * batch_size,
        homes=plan.scenes_per_batch + (training.batches - 1) // plan.batches_per_scene,
        batches=training.batches,
        batch_size=batch_size,
        command=command,
        measured=FRAMES,
        evaluation_homes=evaluation_homes,
        table=table(evaluate_small(path, evaluation_homes)),
    )
    path.with_suffix(".md").write_text(card)
    return path


def evaluate_small(path: Path = SMALL_WEIGHTS, homes: int = EVALUATION_HOMES) -> list[Measure]:
    """Measure the small encoder in a file, beside the shipped text half, on validation homes. Raises WeightsError."""
    plan = evaluation_plan(homes=homes, task=ObjectNavConfig(width=SMALL_SIZE, height=SMALL_SIZE))
    return evaluate_clip(ClipImageEncoder.load_small(path), ClipTextEncoder.load(), evaluation_frames(plan))
