"""Memory for pictures, used again once nobody holds them: the pages of fresh memory cost as much as a tenth of drawing.

Knows nothing of renderers.
"""

import math
import weakref
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

# Blocks kept for later: one step's two arrays, and those of the step before.
_KEPT = 4


class _Lease:
    """What an array of lent memory is built on: it goes with the last array that looks at the memory."""

    def __init__(self, block: NDArray[np.uint8], shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        self.__array_interface__ = {
            "version": 3,
            "shape": shape,
            "typestr": dtype.str,
            "data": (block.ctypes.data, False),
        }


class PictureMemory:
    """Lends arrays whose memory comes back by itself."""

    def __init__(self) -> None:
        self._free: deque[NDArray[np.uint8]] = deque(maxlen=_KEPT)

    def empty(self, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """A contiguous array of what is left in the memory, as `np.empty` gives it."""
        kind = np.dtype(dtype)
        block = self._block(math.prod(shape) * kind.itemsize)
        lease = _Lease(block, shape, kind)
        # It holds the block until the lease is over, and then gives it back.
        weakref.finalize(lease, self._free.append, block).atexit = False
        return np.asarray(lease)

    def _block(self, size: int) -> NDArray[np.uint8]:
        for _ in range(len(self._free)):
            block = self._free.popleft()
            if block.nbytes == size:
                return block
            self._free.append(block)
        return np.empty(size, np.uint8)
