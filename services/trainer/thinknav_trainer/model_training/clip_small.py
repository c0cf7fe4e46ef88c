"""The small image encoder: a pupil that learns to see in 64 by 64 pixels what the CLIP sees in 128 by 128.

The same views are drawn in both sizes, and the pupil learns the CLIP's features, cell by cell; what the embedding makes
of them stays the CLIP's. It goes on where it was stopped.
"""

import itertools
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.utils.data import DataLoader, IterableDataset

from thinknav_models.clip.image import CELLS, FRAME_SIZE, SMALL_KIND, ClipImageEncoder
from thinknav_models.clip.text import CLIP_KIND, CLIP_WEIGHTS
from thinknav_models.weights import load_weights, save_weights
from thinknav_sim.render import set_render_threads
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.model_training.clip_towers import CELL_FEATURES, STEM_CHANNELS, Convolutions
from thinknav_trainer.model_training.drawn_ahead import drawn_ahead
from thinknav_trainer.model_training.frames import FrameMaker, FramePlan
from thinknav_trainer.model_training.training_file import TrainingFile
from thinknav_trainer.precision import autocast
from thinknav_trainer.progress import progress_bar
from thinknav_trainer.threads import torch_threads

SMALL_SIZE = 64
LAYERS = ((64, 2), (64, 1), (128, 2), (128, 1))  # channels and stride of each

_PREFETCH = 4  # batches


@dataclass(frozen=True)
class SmallTraining:
    """How long and how fast. batches: of the whole training; until its last part it does not depend on them."""

    batches: int
    learning_rate: float = 2e-3
    warmup: int = 50
    decay: float = 0.5  # the last part, over which the learning rate falls to zero
    weight_decay: float = 0.01
    checkpoint_every: int = 200
    log_every: int = 20


class SmallTower(nn.Module):
    """Frames (N, 64, 64, 3) to the CLIP's features (N, 64, 4, 4)."""

    def __init__(self) -> None:
        super().__init__()
        self.convolutions = Convolutions(STEM_CHANNELS, LAYERS)
        self.squeeze = nn.Conv2d(self.convolutions.channels, CELL_FEATURES, 1)

    def forward(self, frames: Tensor) -> Tensor:
        features: Tensor = self.squeeze(self.convolutions(frames))
        return features

    @torch.no_grad()
    def save(self, path: Path, clip: Path = CLIP_WEIGHTS) -> str:
        """Write the weights that ship, with the projection of the CLIP that it learnt from; their revision."""
        self.eval()
        tensors = self.convolutions.export()
        tensors["image.squeeze.weight"] = self.squeeze.weight.numpy()
        assert self.squeeze.bias is not None
        tensors["image.squeeze.bias"] = self.squeeze.bias.numpy()
        taught = load_weights(clip, CLIP_KIND).tensors
        tensors |= {name: taught[name] for name in ("image.projection", "image.offset")}
        config = {
            "space": str(ClipImageEncoder.load(clip).space),
            "image": {"frame_size": SMALL_SIZE, "layers": [list(layer) for layer in self.convolutions.sizes]},
        }
        return save_weights(path, SMALL_KIND, config, tensors)


class _Views(IterableDataset[tuple[Tensor, Tensor]]):
    """Frames in the CLIP's size, and small ones of the same views, batch after batch from number `start` on."""

    def __init__(self, plan: FramePlan, start: int) -> None:
        self._plan = plan
        self._start = start

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        torch.set_num_threads(1)
        set_render_threads(1)
        maker = FrameMaker(self._plan)
        for index in itertools.count(self._start):
            large, small = maker.sizes(index, (FRAME_SIZE, SMALL_SIZE))
            yield torch.from_numpy(large), torch.from_numpy(small)


def train_small(plan: FramePlan, training: SmallTraining, folder: Path, interruption: Interruption) -> SmallTower:
    """Teach it from nothing, or from the folder's checkpoint on; finished unless interrupted.

    Writes checkpoint.pt and metrics.jsonl into the folder. Raises WeightsError for a checkpoint of another training.
    """
    torch.manual_seed(plan.seed)
    clip = ClipImageEncoder.load()
    tower: SmallTower = SmallTower().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.AdamW(tower.parameters(), weight_decay=training.weight_decay)
    folder.mkdir(parents=True, exist_ok=True)
    identity = repr((asdict(training) | {"batches": None}, plan, str(clip.space)))
    checkpoint = TrainingFile(folder / "checkpoint.pt", identity, training.batches, training.decay)
    done, state = checkpoint.load()
    if done:
        tower.load_state_dict(state["tower"])
        optimizer.load_state_dict(state["optimizer"])
    if done == training.batches:
        return tower
    with torch_threads(1), progress_bar("clip-small", training.batches, done, "batches") as bar:
        for large, frames in views(plan, done):
            features = clip.features(large).view(-1, CELL_FEATURES, CELLS, CELLS)
            for group in optimizer.param_groups:
                group["lr"] = training.learning_rate * _schedule(training, done)
            with autocast("auto"):
                told = tower(frames)
            loss = functional.mse_loss(told.float(), features.float())
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
            done += 1
            bar.update(done, f"error {float(loss.detach()):.3f}")
            if done % training.log_every == 0:
                with (folder / "metrics.jsonl").open("a") as file:
                    file.write(json.dumps({"batch": done, "error": float(loss.detach())}) + "\n")
            over = done == training.batches or interruption.requested
            if over or done % training.checkpoint_every == 0:
                checkpoint.save(done, {"tower": tower.state_dict(), "optimizer": optimizer.state_dict()})
            if over:
                break
    return tower


def views(plan: FramePlan, start: int = 0) -> Iterator[tuple[Tensor, Tensor]]:
    """Frames (B, 128, 128, 3) and (B, 64, 64, 3) uint8 of the same views, drawn ahead of time in another process."""
    loader = DataLoader(
        _Views(plan, start),
        batch_size=None,
        num_workers=1,
        prefetch_factor=_PREFETCH,
        multiprocessing_context="spawn",
    )
    return drawn_ahead(loader)


def _schedule(training: SmallTraining, done: int) -> float:
    """Share of the learning rate: up from zero over the warm-up, level, and down to zero in a line at last."""
    down = (training.batches - done) / (training.decay * training.batches)
    return min(1.0, (done + 1) / training.warmup, down)
