"""What is asked of a vision-language model, and how its words become instructions.

The words stand in a file, `prompts/navigate-v1.yaml` unless another is given. Knows no particular model.
"""

import hashlib
import math
import re
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from thinknav_proto import PlannerError, PlannerFailed, describe
from thinknav_server.planners.base import Plan, PlanItem

PLAN_LENGTH = 6
_LONGEST_INSTRUCTION = 200
_BUILT_IN = "navigate-v1.yaml"
# "1. ", "2) ", "- ", "* " and the like, with which models number what they list
_BULLET = re.compile(r"^\s*(?:[-*•]|\(?\d{1,2}[.):])\s*")

Part = str | NDArray[np.uint8]
Words = Annotated[str, Field(min_length=1)]


class Prompt(BaseModel):
    """system: how to behave. view, now: before an earlier view and the current one. subgoal, plan: the question."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    system: str
    view: Words
    now: Words
    subgoal: Words
    plan: Words

    @property
    def hash(self) -> str:
        """12 hex digits that change with every word."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]

    def parts(self, item: PlanItem) -> list[Part]:
        """What to show and say to the model, in order: texts, and frames (H, W, 3) uint8."""
        parts: list[Part] = []
        for view in item.recent:
            parts += [self.view.replace("{direction}", heading_in_words(view.heading)), view.frame]
        parts += [self.now, item.frame] if item.recent else [item.frame]
        question = self.plan if item.mode == "plan" else self.subgoal
        parts.append(question.replace("{goal}", item.goal).replace("{count}", str(PLAN_LENGTH)))
        return parts


def load_prompt(path: Path | None) -> Prompt:
    """The prompt in a YAML file, or the built-in one. Raises ValueError naming the file and what is wrong in it."""
    try:
        text = path.read_text(encoding="utf-8") if path else _built_in()
        prompt = Prompt.model_validate(yaml.safe_load(text))
    except OSError as error:
        raise ValueError(f"cannot read the prompt {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"the prompt {path} is not YAML: {' '.join(str(error).split())}") from None
    except ValidationError as error:
        raise ValueError(f"the prompt {path} is wrong: {describe(error)}") from None
    for field in ("subgoal", "plan"):
        if "{goal}" not in getattr(prompt, field):
            raise ValueError(f"the prompt {path} never says what to look for: {field} needs {{goal}}")
    return prompt


def heading_in_words(heading: float) -> str:
    """A heading in radians, left positive, as people say it, to ten degrees."""
    degrees = 10 * round(math.degrees(math.remainder(heading, math.tau)) / 10)
    if degrees == 0:
        return "straight ahead"
    if abs(degrees) == 180:
        return "behind"
    return f"{abs(degrees)} degrees to the {'left' if degrees > 0 else 'right'}"


def plan_from_text(text: str, item: PlanItem) -> Plan | PlannerError:
    """The instructions in a model's answer: the first line that says anything, in mode "plan" all of them."""
    lines = (_BULLET.sub("", line).strip().strip('"') for line in text.splitlines())
    instructions = tuple(line[:_LONGEST_INSTRUCTION] for line in lines if any(map(str.isalnum, line)))
    if not instructions:
        return PlannerFailed("the model said nothing that could be followed")
    return Plan(instructions[:PLAN_LENGTH] if item.mode == "plan" else instructions[:1])


def _built_in() -> str:
    return (files("thinknav_server.planners") / "prompts" / _BUILT_IN).read_text(encoding="utf-8")
