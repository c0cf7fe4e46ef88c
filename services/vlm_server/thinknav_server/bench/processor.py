"""How much processor time a server and the processes that it started have taken. Linux only."""

import os
from pathlib import Path

from thinknav_server.bench.memory import family


def processor_seconds(pid: int) -> float:
    """Of a process and all below it that run now, in user and system mode."""
    return sum(_seconds(process) for process in family(pid))


def _seconds(pid: int) -> float:
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    user, system = fields[11:13]  # the 14th and 15th of all; the first two are cut off
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
