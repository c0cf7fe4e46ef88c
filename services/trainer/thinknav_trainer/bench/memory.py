"""How much memory this process holds, and whether it grows. Linux only: elsewhere it reads the peak instead."""

import ctypes
import resource
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

_STATUS = Path("/proc/self/status")
# What is held differs in size, and allocators keep what they may need again: the first samples are warming up.
_WARM_UP_SHARE = 0.25
ALLOWED_GROWTH = 0.05


def resident_mb() -> float:
    """Resident memory in megabytes (10^6 bytes), once what was freed has been given back where the C library can."""
    if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
        trim(0)
    if _STATUS.exists():
        [line] = [line for line in _STATUS.read_text().splitlines() if line.startswith("VmRSS")]
        return int(line.split()[1]) * 1024 / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6


def growth(megabytes: Sequence[float]) -> float:
    """How much memory grew from the middle of some samples to their end: medians of the two halves after warm-up.

    As a share. Raises ValueError for too few samples to tell.
    """
    warm = megabytes[int(len(megabytes) * _WARM_UP_SHARE) :]
    if len(warm) < 4:
        raise ValueError(f"{len(megabytes)} samples are too few to see memory grow; go on for longer")
    middle = len(warm) // 2
    return float(np.median(warm[middle:]) / np.median(warm[:middle]) - 1)
