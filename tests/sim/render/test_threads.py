"""Renderers beside libraries that bring threads of their own."""

import subprocess
import sys

OPEN3D_FIRST = """
import warnings
import open3d
warnings.simplefilter("error")
import numba
from thinknav_sim.render import set_render_threads
set_render_threads(1)
print(numba.threading_layer())
"""


def test_numba_does_not_try_the_tbb_that_open3d_brings() -> None:
    done = subprocess.run(
        [sys.executable, "-c", OPEN3D_FIRST], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() in ("omp", "workqueue")
