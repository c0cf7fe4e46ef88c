"""A planner that reads from a script and never looks at the picture.

It is for tests, for wiring a trainer to a service, and as a control: the same frame and goal always get the
same sentence, so that a run with it can be repeated, and it knows nothing of where the goal is.
"""

import hashlib
import json
import random
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from thinknav_proto import PlannerError, PlannerFailed, describe
from thinknav_server.planners.base import Plan, PlanItem, PlannerIdentity

PLAN_LENGTH = 4


class Line(BaseModel):
    """A sentence, in which {goal} stands for the goal, and how often it is said relative to the others."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    say: Annotated[str, Field(min_length=1)]
    weight: Annotated[float, Field(gt=0)] = 1.0


def _line(value: object) -> object:
    return {"say": value} if isinstance(value, str) else value


# A line that is a mere sentence has weight 1.
Lines = Annotated[tuple[Annotated[Line, BeforeValidator(_line)], ...], Field(min_length=1)]

_DEFAULT_LINES = (
    Line(say="turn left toward the doorway", weight=3),
    Line(say="turn right toward the doorway", weight=3),
    Line(say="turn left to look for the {goal}", weight=2),
    Line(say="turn right to look for the {goal}", weight=2),
    Line(say="move forward to the {goal}", weight=4),
    Line(say="move forward through the doorway", weight=4),
    Line(say="stop, the {goal} is right ahead", weight=0.2),
)


class Script(BaseModel):
    """What to say: `default` for every goal but those that have lines of their own in `goals`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    default: Lines = _DEFAULT_LINES
    goals: dict[str, Lines] = {}

    def revision(self) -> str:
        """12 hex digits of the script's hash."""
        text = json.dumps(self.model_dump(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def choose(self, goal: str, draw: float) -> str:
        """The sentence for a goal that a number from 0 to 1 (excluded) falls on, by weight."""
        lines = self.goals.get(goal, self.default)
        remaining = draw * sum(line.weight for line in lines)
        for line in lines:
            remaining -= line.weight
            if remaining < 0:
                break
        return line.say.replace("{goal}", goal)


def load_script(path: Path) -> Script:
    """The script in a YAML or JSON file. Raises ValueError naming the file and what is wrong in it."""
    try:
        return Script.model_validate(yaml.safe_load(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ValueError(f"cannot read the script {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"the script {path} is not YAML: {' '.join(str(error).split())}") from None
    except ValidationError as error:
        raise ValueError(f"the script {path} is wrong: {describe(error)}") from None


class ScriptedPlanner:
    """Says what the script says, chosen by a hash of the frame's pixels and the goal; ignores the temperature.

    latency: seconds that each batch takes. failure_rate: share of items that fail, drawn in order from `seed`.
    """

    def __init__(
        self, script: Script | None = None, latency: float = 0.0, failure_rate: float = 0.0, seed: int = 0
    ) -> None:
        self._script = script or Script()
        self._latency = latency
        self._failure_rate = failure_rate
        self._failures = random.Random(seed)
        self._identity = PlannerIdentity("scripted", self._script.revision(), "none")

    @property
    def identity(self) -> PlannerIdentity:
        return self._identity

    def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
        if self._latency:
            time.sleep(self._latency)
        return [self._answer(item) for item in items]

    def _answer(self, item: PlanItem) -> Plan | PlannerError:
        if self._failures.random() < self._failure_rate:
            return PlannerFailed("the scripted planner fails this time, as its failure rate asks")
        steps = PLAN_LENGTH if item.mode == "plan" else 1
        return Plan(tuple(self._script.choose(item.goal, _draw(item, step)) for step in range(steps)))


def _draw(item: PlanItem, step: int) -> float:
    """A number from 0 to 1 (excluded) that depends on the pixels, the goal and the step alone."""
    height, width, _ = item.frame.shape
    digest = hashlib.blake2b(f"{width}x{height}:{step}:{item.goal}:".encode(), digest_size=6)
    digest.update(item.frame.tobytes())
    return int.from_bytes(digest.digest(), "big") / 2**48
