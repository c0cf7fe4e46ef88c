"""How long a scan takes to load for the first time, and from the cache.

python benchmarks/scan_loading.py SCAN [SCAN ...]
"""

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

from thinknav_sim.scans import load_scan


def measure(path: Path, rounds: int) -> tuple[list[float], list[float]]:
    """Seconds of first and second loads, each in an empty cache. Compiled code is warmed up before."""
    load_scan(path, cache=False)
    first: list[float] = []
    second: list[float] = []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            os.environ["THINKNAV_CACHE"] = folder
            for seconds in (first, second):
                start = time.perf_counter()
                load_scan(path)
                seconds.append(time.perf_counter() - start)
    return first, second


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scans", nargs="+", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    for path in arguments.scans:
        first, second = (statistics.median(seconds) for seconds in measure(path, arguments.rounds))
        print(f"{path.name}: {1e3 * first:.0f} ms, cached {1e3 * second:.1f} ms, {first / second:.0f} times faster")  # noqa: T201


if __name__ == "__main__":
    main()
