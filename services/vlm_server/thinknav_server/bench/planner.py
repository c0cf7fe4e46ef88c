"""The emulated model as a planner."""

from collections.abc import Sequence

from thinknav_proto import PlannerError, PlannerFailed
from thinknav_server.bench.model import Emulated
from thinknav_server.planners import Plan, PlanItem, PlannerIdentity

# The goal on which it fails.
POISON = "the goal that breaks the planner"


class EmulatedPlanner:
    """base, item: milliseconds, as the command line gives them."""

    def __init__(self, base: str, item: str) -> None:
        self.identity = PlannerIdentity("emulated", f"{base}-{item}", "none")
        self._model = Emulated(float(base), float(item))

    def plan(self, items: Sequence[PlanItem]) -> list[Plan | PlannerError]:
        """Raises PlannerFailed for a poisoned batch."""
        if any(item.goal == POISON for item in items):
            raise PlannerFailed("the planner was asked to fail")
        return [Plan((text,)) for text in self._model(len(items))]
