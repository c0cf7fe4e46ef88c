"""In which number format the policy acts and learns."""

from contextlib import AbstractContextManager
from typing import Any, Literal

import torch

from thinknav_models.bfloat16 import bfloat16_is_fast

Precision = Literal["auto", "float32", "bfloat16"]


def autocast(precision: Precision) -> AbstractContextManager[Any]:
    """Matrix products in bfloat16 where `precision` says so, or, for auto, where it is fast."""
    enabled = precision == "bfloat16" or (precision == "auto" and bfloat16_is_fast())
    return torch.autocast("cpu", torch.bfloat16, enabled=enabled)
