"""Which planner and text encoder to load, and how: plain values, so that they can be sent to another process.

Heavy libraries are imported only when a planner that needs them is chosen.
"""

import importlib
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from thinknav_models import TextEncoder
from thinknav_models.clip import shipped_text_encoder
from thinknav_server.planners.base import Planner
from thinknav_server.planners.scripted import Script, ScriptedPlanner, load_script
from thinknav_server.thinking import Thinker


class _Options(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ScriptedOptions(_Options):
    """script: YAML or JSON file with the sentences. latency: seconds that each batch takes.
    failure_rate: share of requests that fail. seed: of the failures.
    """

    script: Path | None = None
    latency: Annotated[float, Field(ge=0)] = 0.0
    failure_rate: Annotated[float, Field(ge=0, le=1)] = 0.0
    seed: int = 0


class PlannerOptions(_Options):
    """planner: "scripted", or "package.module:factory" for one of your own, called with `arguments`."""

    planner: str = "scripted"
    arguments: dict[str, str] = {}
    scripted: ScriptedOptions = ScriptedOptions()

    @property
    def cheap(self) -> bool:
        """Whether the planner may run in a thread of the service: it cannot hang or take the process down."""
        return self.planner == "scripted"


def load_thinker(options: PlannerOptions) -> Thinker:
    """The planner and text encoder. Raises ValueError for options that cannot be followed, saying what to do."""
    return Thinker(_load_planner(options), _load_text_encoder(options))


def _load_planner(options: PlannerOptions) -> Planner:
    if options.planner == "scripted":
        chosen = options.scripted
        script = load_script(chosen.script) if chosen.script else Script()
        return ScriptedPlanner(script, chosen.latency, chosen.failure_rate, chosen.seed)
    return _load_foreign(options)


def _load_foreign(options: PlannerOptions) -> Planner:
    module_name, colon, name = options.planner.partition(":")
    if not colon:
        raise ValueError(
            f"there is no planner {options.planner!r}; choose scripted or name your own as package.module:factory"
        )
    try:
        factory = getattr(importlib.import_module(module_name), name)
        planner: Planner = factory(**options.arguments)
    except (ImportError, AttributeError, TypeError) as error:
        raise ValueError(f"cannot make the planner {options.planner!r}: {error}") from error
    return planner


def _load_text_encoder(_options: PlannerOptions) -> TextEncoder:
    return shipped_text_encoder()
