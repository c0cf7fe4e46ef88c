"""How many threads draw."""

import os
import threading

import numba

# Open3D and Embree bring a TBB of their own. Where they were loaded first, Numba would find that, and warn of its age.
if "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "workqueue", "tbb"]  # type: ignore[attr-defined]

# Numba's last-resort threading layer aborts the process when two threads enter it at once.
PARALLEL_REGION = threading.Lock()


def set_render_threads(count: int) -> None:
    """Let renderers use this many threads from now on; as many as numba started with at the most."""
    available = int(os.environ.get("NUMBA_NUM_THREADS", os.cpu_count() or 1))
    numba.set_num_threads(max(1, min(count, available)))
