"""The emulated model as a planner."""

from collections.abc import Sequence

from thinknav_server.bench.model import Emulated
from thinknav_server.planners import Plan, PlanItem, PlannerIdentity


class EmulatedPlanner:
    """base, item: milliseconds, as the command line gives them."""

    def __init__(self, base: str, item: str) -> None:
        self.identity = PlannerIdentity("emulated", f"{base}-{item}", "none")
        self._model = Emulated(float(base), float(item))

    def plan(self, items: Sequence[PlanItem]) -> list[Plan]:
        return [Plan((text,)) for text in self._model(len(items))]
