"""How much memory a server and the processes that it started hold. Linux only."""

import os
from pathlib import Path


def resident_mb(pid: int) -> float:
    """Resident memory of a process and all below it, in megabytes (10^6 bytes). One that ends meanwhile counts as 0."""
    return sum(_resident_mb(process) for process in family(pid))


def family(pid: int) -> list[int]:
    """A process and all below it that run now, the process first."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [child for task in tasks for child in (task / "children").read_text(encoding="ascii").split()]
    except (FileNotFoundError, ProcessLookupError):
        return []
    return [pid, *(process for child in children for process in family(int(child)))]


def _resident_mb(pid: int) -> float:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
