"""How much memory a server and the processes that it started hold. Linux only."""

from pathlib import Path

_PAGE = 4096


def resident_mb(pid: int) -> float:
    """Resident memory of a process and all below it, in megabytes (10^6 bytes). One that ends meanwhile counts as 0."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [child for task in tasks for child in (task / "children").read_text(encoding="ascii").split()]
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return pages * _PAGE / 1e6 + sum(resident_mb(int(child)) for child in children)
