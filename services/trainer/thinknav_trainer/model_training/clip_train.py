"""The training of the small CLIP: batch, loss, step, save. It goes on where it was stopped."""

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from thinknav_models.clip.text import CLIP_KIND
from thinknav_models.weights import save_weights
from thinknav_sim.render import set_render_threads
from thinknav_trainer.dumps import TrainingDiverged
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.clip_data import ClipBatch, clip_batches
from thinknav_trainer.model_training.clip_loss import ClipLoss
from thinknav_trainer.model_training.clip_towers import ImageTower, TextTower
from thinknav_trainer.model_training.frames import FramePlan
from thinknav_trainer.model_training.grammar import words
from thinknav_trainer.model_training.training_file import TrainingFile
from thinknav_trainer.precision import autocast
from thinknav_trainer.progress import progress_bar
from thinknav_trainer.threads import torch_threads

COARSE = 1 / 3  # of the batches have half the resolution


@dataclass(frozen=True)
class ClipTraining:
    """How long and how fast. batches: of the whole training.

    Until its last part a training does not depend on its length, so that a checkpoint from before may be trained for
    longer, or shorter, than was planned (`TrainingFile`).
    """

    batches: int
    learning_rate: float = 1.5e-3
    warmup: int = 50
    decay: float = 0.3  # the last part, over which the learning rate falls to zero
    weight_decay: float = 0.05
    checkpoint_every: int = 50
    log_every: int = 10


class ClipModel(nn.Module):
    """Both towers and the loss between them."""

    def __init__(self, vocabulary: tuple[str, ...]) -> None:
        super().__init__()
        self.image = ImageTower().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.text = TextTower(vocabulary)
        self.loss = ClipLoss()

    def forward(self, batch: ClipBatch) -> tuple[Tensor, dict[str, float]]:
        """The loss of a batch, and what it is made of."""
        with autocast("auto"):
            images = self.image(jittered(batch.rgb))
            texts = torch.stack([self.text(numbers).float() for numbers in batch.words])
        loss, parts = self.loss(images, texts, batch)
        return loss, parts

    def save(self, path: Path) -> str:
        """Write the weights that ship, and return their revision."""
        self.eval()
        image_config, image = self.image.export()
        text_config, text = self.text.export()
        self.train()
        return save_weights(path, CLIP_KIND, {"image": image_config, "text": text_config}, image | text)


def train_clip(
    plan: FramePlan, training: ClipTraining, vocabulary: tuple[str, ...], folder: Path, interruption: Interruption
) -> ClipModel:
    """Train from nothing, or from the folder's checkpoint on; returns the model, finished unless interrupted.

    Writes checkpoint.pt and metrics.jsonl into the folder. Raises WeightsError for a checkpoint of another training,
    TrainingDiverged when the loss is not finite.
    """
    set_render_threads(1)
    torch.manual_seed(plan.seed)
    model = ClipModel(vocabulary)
    optimizer = torch.optim.AdamW(_parameter_groups(model, training.weight_decay), betas=(0.9, 0.98))
    identity = repr((asdict(training) | {"batches": None}, plan, model.text.vocabulary))
    checkpoint = TrainingFile(folder / "checkpoint.pt", identity, training.batches, training.decay)
    done, state = checkpoint.load()
    if done:
        model.load_state_dict(state["model"])
        optimizer.load_state_dict(state["optimizer"])
        torch.set_rng_state(state["random"])
    folder.mkdir(parents=True, exist_ok=True)
    if done == training.batches:
        return model
    batches = _batches_from(plan, vocabulary, done)
    with torch_threads(1), progress_bar("clip", training.batches, done, "batches") as bar:
        while done < training.batches and not interruption.requested:
            for group in optimizer.param_groups:
                group["lr"] = learning_rate(training, done)
            loss, parts = model(next(batches))
            if not math.isfinite(float(loss.detach())):
                raise TrainingDiverged(f"the loss of batch {done} is not finite: {parts}")
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(model.parameters(), 1.0)
            optimizer.step()
            done += 1
            bar.update(done, f"loss {float(loss.detach()):.2f}, found {parts['found_0']:.2f}")
            if done % training.log_every == 0:
                _log(folder, {"batch": done, "loss": float(loss.detach())} | parts)
            if done % training.checkpoint_every == 0 or done == training.batches or interruption.requested:
                parts = {"model": model.state_dict(), "optimizer": optimizer.state_dict()}
                checkpoint.save(done, {**parts, "random": torch.get_rng_state()})
    return model


def _batches_from(plan: FramePlan, vocabulary: tuple[str, ...], done: int) -> Iterator[ClipBatch]:
    """Batches from number `done` on; who goes on draws as one who never stopped."""
    restored = torch.get_rng_state()
    batches = clip_batches(plan, vocabulary, done)  # whose processes begin with a number that is drawn here
    if done:
        torch.set_rng_state(restored)
    return batches


def vocabulary_for(categories: tuple[str, ...] = ()) -> tuple[str, ...]:
    """The words of all sentences: the grammar's, and those of the categories that it has no words for."""
    own = {word for category in categories for word in category.lower().replace("_", " ").split()}
    plurals = {form for word in own for form in (word + "s", word + "es")}
    return tuple(sorted({*words(), *own, *plurals}))


def learning_rate(training: ClipTraining, done: int) -> float:
    """Up from zero over the warm-up, level, and down to zero in a line over the last part."""
    up = (done + 1) / training.warmup
    down = (training.batches - done) / (training.decay * training.batches)
    return training.learning_rate * min(1.0, up, down)


def jittered(rgb: Tensor) -> Tensor:
    """Frames (B, H, W, 3) uint8 in another light: as floats, brightness, contrast and tint changed, some grey.

    A third of the time they are coarse, as those of an environment with small pictures are.
    """
    frames = rgb.to(torch.bfloat16)
    count = len(frames)
    if torch.rand(()) < COARSE:
        small = functional.avg_pool2d(frames.permute(0, 3, 1, 2), 2)
        frames = functional.interpolate(small, rgb.shape[1:3], mode="bilinear").permute(0, 2, 3, 1)
    gain = torch.empty(count, 1, 1, 3).uniform_(0.9, 1.1) * torch.empty(count, 1, 1, 1).uniform_(0.75, 1.3)
    shift = torch.empty(count, 1, 1, 1).uniform_(-20, 20)
    grey = torch.rand(count) < 0.05
    frames[grey] = frames[grey].mean(dim=-1, keepdim=True).expand(-1, -1, -1, 3)
    return (frames * gain.to(frames.dtype) + shift.to(frames.dtype)).clamp_(0, 255)


def _parameter_groups(model: ClipModel, weight_decay: float) -> list[dict[str, Any]]:
    matrices = [parameter for parameter in model.parameters() if parameter.ndim > 1]
    rest = [parameter for parameter in model.parameters() if parameter.ndim <= 1]
    return [{"params": matrices, "weight_decay": weight_decay}, {"params": rest, "weight_decay": 0.0}]


def _log(folder: Path, row: dict[str, float]) -> None:
    with (folder / "metrics.jsonl").open("a") as file:
        file.write(json.dumps(row) + "\n")
