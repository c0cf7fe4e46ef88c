"""Which of torchrun's processes this is, by the environment that it gives them. Needs no torch."""

import os


def started_by_torchrun() -> bool:
    """Whether this process is one of several."""
    return {"RANK", "WORLD_SIZE", "MASTER_ADDR"} <= os.environ.keys()


def own_rank() -> int:
    """This process's place among the workers; 0 for a lone one."""
    return int(os.environ["RANK"]) if started_by_torchrun() else 0


def times_restarted() -> int:
    """How often torchrun has restarted the workers."""
    return int(os.environ.get("TORCHELASTIC_RESTART_COUNT", "0"))
