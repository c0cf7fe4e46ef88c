"""What `thinknav models train clip` and `evaluate clip` do, in order: train, save, evaluate, write the card."""

from collections.abc import Sequence
from pathlib import Path

from thinknav_models.clip import ClipTextEncoder
from thinknav_models.clip.image import ClipImageEncoder
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.clip_card import model_card
from thinknav_trainer.model_training.clip_evaluate import (
    EVALUATION_SEED,
    FRAMES,
    DirectionGap,
    Measure,
    direction_gap,
    evaluate_clip,
    evaluation_frames,
)
from thinknav_trainer.model_training.clip_train import ClipTraining, train_clip, vocabulary_for
from thinknav_trainer.model_training.frames import FramePlan, HomeSource, ScanSource, SceneSource

WEIGHTS_NAME = "clip.safetensors"
CARD_NAME = "clip.md"
EVALUATION_HOMES = 50


def train_and_describe(
    output: Path,
    checkpoints: Path,
    training: ClipTraining,
    scans: Sequence[Path],
    command: str,
    interruption: Interruption,
    seed: int = 0,
    evaluation_homes: int = EVALUATION_HOMES,
) -> Path | None:
    """Train, or go on training, write weights and card into a folder; the path of the weights, None if interrupted."""
    source: SceneSource = ScanSource(tuple(scans)) if scans else HomeSource("planner")
    plan = FramePlan(source, ObjectNavConfig(), seed)
    categories = source.categories() if isinstance(source, ScanSource) else ()
    model = train_clip(plan, training, vocabulary_for(categories), checkpoints, interruption)
    if interruption.requested:
        return None
    output.mkdir(parents=True, exist_ok=True)
    path = output / WEIGHTS_NAME
    revision = model.save(path)
    measures, gap = evaluate_weights(path, scans, evaluation_homes)
    card = model_card(
        revision=revision,
        size=path.stat().st_size,
        data=_training_data(plan, training, scans),
        command=command,
        batches=training.batches,
        batch_size=plan.scenes_per_batch * plan.frames_per_scene,
        frames=FRAMES,
        homes=_evaluation_data(scans, evaluation_homes),
        measures=measures,
        gap=gap,
    )
    (output / CARD_NAME).write_text(card)
    return path


def evaluate_weights(
    path: Path, scans: Sequence[Path] = (), homes: int = EVALUATION_HOMES
) -> tuple[list[Measure], DirectionGap]:
    """Measure the weights in a file on validation homes, or on scans. Raises WeightsError, SceneError."""
    text_encoder, image_encoder = ClipTextEncoder.load(path), ClipImageEncoder.load(path)
    frames = evaluation_frames(evaluation_plan(scans, homes))
    return evaluate_clip(image_encoder, text_encoder, frames), direction_gap(text_encoder.encode)


def evaluation_plan(
    scans: Sequence[Path] = (), homes: int = EVALUATION_HOMES, task: ObjectNavConfig = ObjectNavConfig()
) -> FramePlan:
    """FRAMES frames of validation homes, or of scans. task: the size of its pictures counts."""
    source: SceneSource = ScanSource(tuple(scans)) if scans else HomeSource("val")
    count = len(scans) or homes
    return FramePlan(
        source,
        task,
        seed=EVALUATION_SEED,
        scenes_per_batch=count,
        frames_per_scene=-(-FRAMES // count),
        mirror=False,
    )


def _training_data(plan: FramePlan, training: ClipTraining, scans: Sequence[Path]) -> str:
    if scans:
        return f"Frames of the scans {', '.join(path.name for path in scans)}, at random poses."
    homes = plan.scenes_per_batch + (training.batches - 1) // plan.batches_per_scene
    return (
        f"{training.batches * plan.scenes_per_batch * plan.frames_per_scene:,} frames of {homes:,} procedural homes of "
        "the planner-training seeds, 128 x 128 pixels:\n60 % from anywhere, 40 % from near an object and turned to it."
    )


def _evaluation_data(scans: Sequence[Path], homes: int) -> str:
    if scans:
        return f"{', '.join(path.name for path in scans)}, the scans that it was trained in, from other places"
    return f"{homes} validation homes, never seen in training"
