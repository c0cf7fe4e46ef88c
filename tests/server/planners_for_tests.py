"""Planners that misbehave when asked to, loaded by name in processes of their own."""

import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path

from thinknav_server.planners import Plan, PlanItem, PlannerIdentity


class Naughty:
    """Does what the goal says: "die", "hang", "raise", "exit", or else is good. Says its process' number.

    fail_while: loading fails while this file exists. loads: a file that counts how often it was loaded.
    planned: a file that gets the goal of each item when its batch begins, a line each.
    """

    identity = PlannerIdentity("naughty", "r1", "none")

    def __init__(self, fail_while: str = "", loads: str = "", planned: str = "") -> None:
        self._planned = planned
        if fail_while and Path(fail_while).exists():
            raise ValueError(f"not while {fail_while} exists")
        if loads:
            with Path(loads).open("a") as file:
                file.write("loaded\n")

    def plan(self, items: Sequence[PlanItem]) -> list[Plan]:
        goals = [item.goal for item in items]
        if self._planned:
            with Path(self._planned).open("a") as file:
                file.write("".join(f"{goal}\n" for goal in goals))
        if "die" in goals:
            os.kill(os.getpid(), signal.SIGKILL)
        if "exit" in goals:
            os._exit(3)
        if "hang" in goals:
            while True:
                time.sleep(0.01)
        if "raise" in goals:
            raise RuntimeError("choked")
        for goal in goals:
            if goal.startswith("sleep "):
                time.sleep(float(goal.split()[1]))
        return [Plan((f"{goal} says {os.getpid()}",)) for goal in goals]


def refuses() -> Naughty:
    raise ValueError("this planner never loads; choose another")


def breaks() -> Naughty:
    raise RuntimeError("out of memory, say")


def dies() -> Naughty:
    os._exit(7)


def hangs() -> Naughty:
    time.sleep(600)
    return Naughty()
