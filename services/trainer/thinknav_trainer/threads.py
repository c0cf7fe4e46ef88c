"""How many threads torch works with, for a while."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Within the block, or the function that this decorates, torch uses this many threads.

    The products of one step of some agents are small: a second thread costs more in waiting than it gives.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
