"""The zenoh key expressions of planning services.

Each replica of a service answers under keys of its own, and clients choose among the replicas that are alive,
because zenoh does not share load between queryables on one key. Pure functions of strings; nothing here
imports zenoh.
"""

import re

PREFIX = "thinknav/v1/planner"

# Matches the liveliness token of every replica.
ALL_ALIVE = f"{PREFIX}/*/alive"

_REPLICA = re.compile(r"[A-Za-z0-9_.-]{1,64}")


def subgoal_key(replica: str) -> str:
    """Where a replica answers requests for subgoals."""
    return _key(replica, "subgoal")


def embed_key(replica: str) -> str:
    """Where a replica embeds texts."""
    return _key(replica, "embed")


def info_key(replica: str) -> str:
    """Where a replica tells its PlannerInfo."""
    return _key(replica, "info")


def alive_key(replica: str) -> str:
    """The liveliness token that a replica holds while it serves."""
    return _key(replica, "alive")


def replica_of(key: str) -> str:
    """The replica that a key belongs to. Raises ValueError for a key that is not a planner's."""
    prefix, _, rest = key.partition(f"{PREFIX}/")
    replica, slash, leaf = rest.partition("/")
    if prefix or not slash or leaf not in ("subgoal", "embed", "info", "alive") or not _REPLICA.fullmatch(replica):
        raise ValueError(f"{key!r} is not a key of a planner; those read {PREFIX}/<replica>/subgoal")
    return replica


def _key(replica: str, leaf: str) -> str:
    if not _REPLICA.fullmatch(replica):
        raise ValueError(f"a replica is named by 1 to 64 of the characters A-Z a-z 0-9 _ . -, not {replica!r}")
    return f"{PREFIX}/{replica}/{leaf}"
