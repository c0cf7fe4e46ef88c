"""Tests run on one thread: idle OpenMP threads that spin would slow down whatever else the machine does."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
