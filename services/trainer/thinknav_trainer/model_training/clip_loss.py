"""The contrastive loss of the small CLIP: a frame and its sentences find each other among all others of a batch.

After Radford et al. 2021, with a false sentence of each frame's own among those to tell apart. Sentences that happen to
be the same are not told apart. Beside it, subgoals are sorted by their direction: a policy steers by that.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from thinknav_models.clip.text import DIMENSION
from thinknav_trainer.model_training.clip_data import FALSE, KINDS, LONG, NO_DIRECTION, SHORT, SUBGOAL, ClipBatch

KIND_WEIGHTS = {LONG: 1.0, SHORT: 0.5, SUBGOAL: 0.5}
DIRECTION_WEIGHT = 0.2
DIRECTION_SCALE = 10.0
LARGEST_SCALE = 100.0


class ClipLoss(nn.Module):
    """Learnt: the scale of similarities (one over the temperature), and where each direction lies."""

    def __init__(self) -> None:
        super().__init__()
        self.log_scale = nn.Parameter(torch.tensor(2.66))  # 1 / 0.07, as CLIP starts
        self.directions = nn.Parameter(torch.randn(NO_DIRECTION + 1, DIMENSION))

    def forward(self, images: Tensor, texts: Tensor, batch: ClipBatch) -> tuple[Tensor, dict[str, float]]:
        """The loss and what it is made of. images: (B, 512), texts: (KINDS, B, 512), of any length."""
        images, texts = functional.normalize(images.float(), dim=-1), functional.normalize(texts.float(), dim=-1)
        scale = self.log_scale.exp().clamp(max=LARGEST_SCALE)
        rows = torch.arange(len(images))
        loss = torch.zeros(())
        parts: dict[str, float] = {}
        false = scale * images @ texts[FALSE].T
        for kind, weight in KIND_WEIGHTS.items():
            same = batch.same[kind][:, None] == batch.same[kind][None]
            same[rows, rows] = False
            true = (scale * images @ texts[kind].T).masked_fill(same, -torch.inf)
            to_text = functional.cross_entropy(torch.cat([true, false], dim=1), rows)
            to_image = functional.cross_entropy(true.T, rows)
            loss = loss + weight * (to_text + to_image) / 2
            found = (true.argmax(dim=1) == rows).float().mean()
            parts |= {f"loss_{kind}": float(to_text.detach()), f"found_{kind}": float(found)}
        directions = functional.normalize(self.directions, dim=-1)
        logits = DIRECTION_SCALE * texts.flatten(0, 1) @ directions.T
        sorting = functional.cross_entropy(logits, batch.directions.flatten())
        own_false = (torch.diagonal(false) < torch.diagonal(scale * images @ texts[LONG].T)).float().mean()
        parts |= {"loss_direction": float(sorting.detach()), "true_over_false": float(own_false)}
        parts |= {"scale": float(scale.detach()), "kinds": float(KINDS)}
        return loss + DIRECTION_WEIGHT * sorting, parts
