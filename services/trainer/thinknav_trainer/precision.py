"""In which number format the policy acts and learns."""

from contextlib import AbstractContextManager
from typing import Any, Literal

import torch

Precision = Literal["auto", "float32", "bfloat16"]


def bfloat16_is_fast() -> bool:
    """Whether this processor multiplies bfloat16 natively (AVX-512 BF16, AMX)."""
    check = getattr(torch.cpu, "_is_avx512_bf16_supported", None)  # not in every torch from 2.6 on
    return check is not None and bool(check())


def autocast(precision: Precision) -> AbstractContextManager[Any]:
    """Matrix products in bfloat16 where `precision` says so, or, for auto, where it is fast."""
    enabled = precision == "bfloat16" or (precision == "auto" and bfloat16_is_fast())
    return torch.autocast("cpu", torch.bfloat16, enabled=enabled)
