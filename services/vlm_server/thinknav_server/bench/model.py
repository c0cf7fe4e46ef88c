"""A model that takes its time as one on an accelerator does: so much a batch, so much an item, no processor.

It is the same behind the service and behind its peer, where this file is run without the rest of the project.
"""

import time


class Emulated:
    """base, item: milliseconds for a batch, and for each item in it."""

    def __init__(self, base: float, item: float) -> None:
        self._base = base
        self._item = item

    def __call__(self, count: int) -> list[str]:
        """A sentence for each item."""
        time.sleep((self._base + self._item * count) / 1000)
        return ["turn left toward the doorway"] * count
