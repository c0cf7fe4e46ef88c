"""In which number format the policy acts and learns."""

from contextlib import AbstractContextManager, nullcontext
from typing import Any

import torch

from thinknav_models.bfloat16 import bfloat16_is_fast
from thinknav_trainer.config import Precision

CPU = torch.device("cpu")


def autocast(precision: Precision, device: torch.device = CPU) -> AbstractContextManager[Any]:
    """A device's matrix products in bfloat16 where `precision` says so, or, for auto, where it is fast."""
    enabled = precision == "bfloat16" or (precision == "auto" and _is_fast(device))
    return torch.autocast(device.type, torch.bfloat16) if enabled else nullcontext()


def _is_fast(device: torch.device) -> bool:
    if device.type == "cuda":
        return torch.cuda.get_device_capability(device) >= (8, 0)
    return bfloat16_is_fast()
