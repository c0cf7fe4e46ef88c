"""The embedded planner: the small subgoal VLM that ships with ThinkNav. It needs no download and no GPU."""

from collections.abc import Sequence
from pathlib import Path

import torch

from thinknav_models.subgoal_vlm import SHIPPED_FILE, Question, SubgoalVLM
from thinknav_server.planners.base import Plan, PlanItem, PlannerIdentity


class EmbeddedPlanner:
    """The subgoal VLM in a file.

    weights: of `thinknav models train`; the shipped ones unless given. seed: of what is drawn at a temperature.
    threads: how many a batch is worked on with; of such a small model, more than one gains little.
    Raises WeightsError for a file that cannot be used.
    """

    def __init__(self, weights: Path | None = None, seed: int = 0, threads: int = 1) -> None:
        torch.set_num_threads(threads)
        self._model, revision = SubgoalVLM.load(weights or SHIPPED_FILE, seed)
        self._identity = PlannerIdentity("embedded", revision, "none")

    @property
    def identity(self) -> PlannerIdentity:
        return self._identity

    def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan]:
        questions = [
            Question(
                item.frame,
                item.goal,
                tuple((view.frame, view.heading) for view in item.recent),
                item.mode,
                item.temperature,
            )
            for item in items
        ]
        return [Plan(answer.sentences, answer.confidence) for answer in self._model.answer(questions)]
