"""Whether bfloat16 is worth its rounding on this processor."""

import torch


def bfloat16_is_fast() -> bool:
    """Whether this processor multiplies bfloat16 natively (AVX-512 BF16, AMX)."""
    check = getattr(torch.cpu, "_is_avx512_bf16_supported", None)  # not in every torch from 2.6 on
    return check is not None and bool(check())
