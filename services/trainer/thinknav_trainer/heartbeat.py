"""Who lives, when workers are no longer together: each tells the others twice a second, over a store they share.

Knows nothing of what they do, but for how many meetings each has come to.
"""

import threading
import time
from typing import NamedTuple

from torch.distributed.distributed_c10d import Store

from thinknav_trainer.workers import WorkerLost

BEAT_S = 0.5
SILENCE_S = 4.0  # who says nothing for so long is gone


class _Sign(NamedTuple):
    beats: int
    meetings: int


class Heartbeat:
    """Within its `with` block this worker gives signs of life."""

    def __init__(self, store: Store, rank: int, count: int, patience: float) -> None:
        """patience: seconds that a meeting waits for those who are late."""
        self._store = store
        self._rank = rank
        self._others = [other for other in range(count) if other != rank]
        self._patience = patience
        self._meetings = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="heartbeat", daemon=True)

    def __enter__(self) -> "Heartbeat":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def came_to_meeting(self) -> None:
        self._meetings += 1

    def diagnose(self, failure: RuntimeError) -> WorkerLost:
        """Why a meeting failed: who is gone, or who did not come."""
        try:
            before = {rank: self._sign_of(rank) for rank in self._others}
            time.sleep(SILENCE_S)
            after = {rank: self._sign_of(rank) for rank in self._others}
        except RuntimeError:
            return WorkerLost("worker 0 is gone, or its host cannot be reached")
        silent = [rank for rank in self._others if before[rank].beats == after[rank].beats]
        if silent:
            return WorkerLost(f"{_named(silent)} gone: killed, or cut off")
        late = [rank for rank in self._others if after[rank].meetings < self._meetings]
        if late:
            return WorkerLost(f"{_named(late)} late: waited for {self._patience:g} s (workers.timeout)")
        return WorkerLost(f"the workers have lost each other: {(str(failure).splitlines() or ['no reason given'])[0]}")

    def _beat(self) -> None:
        beats = 0
        while True:
            beats += 1
            try:
                self._store.set(f"sign/{self._rank}", f"{beats} {self._meetings}")
            except RuntimeError:  # the store is gone, and with it whoever could read this
                return
            if self._over.wait(BEAT_S):
                return

    def _sign_of(self, rank: int) -> _Sign:
        key = f"sign/{rank}"
        if not self._store.check([key]):
            return _Sign(0, 0)
        beats, meetings = self._store.get(key).split()
        return _Sign(int(beats), int(meetings))


def _named(ranks: list[int]) -> str:
    names = " and ".join(map(str, ranks))
    return f"worker {names} is" if len(ranks) == 1 else f"workers {names} are"
