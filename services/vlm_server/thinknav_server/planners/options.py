"""Which planner and text encoder to load, and how: plain values, so that they can be sent to another process.

Heavy libraries are imported only when a planner that needs them is chosen.
"""

import importlib
import sys
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from thinknav_models import TextEncoder
from thinknav_models.clip import shipped_text_encoder
from thinknav_server.planners.base import Planner
from thinknav_server.planners.scripted import Script, ScriptedPlanner, load_script
from thinknav_server.thinking import Thinker


class _Options(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class EmbeddedOptions(_Options):
    """weights: a file of `thinknav models train subgoal`; the shipped ones unless given.
    seed: of what is drawn at a temperature. threads: that a batch is worked on with.
    """

    weights: Path | None = None
    seed: int = 0
    threads: Annotated[int, Field(ge=1)] = 1


class ScriptedOptions(_Options):
    """script: YAML or JSON file with the sentences. latency: seconds that each batch takes.
    failure_rate: share of requests that fail. seed: of the failures.
    """

    script: Path | None = None
    latency: Annotated[float, Field(ge=0)] = 0.0
    failure_rate: Annotated[float, Field(ge=0, le=1)] = 0.0
    seed: int = 0


class QwenOptions(_Options):
    """model: a folder, or a name on the Hugging Face hub. device: "auto" takes CUDA where there is one.
    max_new_tokens: of one instruction. prompt: YAML file with other words than the built-in ones.
    decode: over which cache words are generated, and whether compiled. decode_rows: requests generated at once, where
    that is not "dynamic".
    """

    model: str = "Qwen/Qwen3-VL-2B-Instruct"
    device: str = "auto"
    max_new_tokens: Annotated[int, Field(ge=1)] = 24
    decode: Literal["dynamic", "static", "compiled"] = "dynamic"
    decode_rows: Annotated[int, Field(ge=1)] = 64
    prompt: Path | None = None


class OpenAIOptions(_Options):
    """url: of the server, up to and with "/v1". model: one that it serves; "" takes the only one.
    key_env: environment variable with the key, if the server wants one. concurrency: calls at once.
    timeout: seconds for a call. guided: ask for JSON by a schema, as long as the server understands that.
    """

    url: str = "http://127.0.0.1:8000/v1"
    model: str = ""
    key_env: str = "OPENAI_API_KEY"
    concurrency: Annotated[int, Field(ge=1)] = 64
    timeout: Annotated[float, Field(gt=0)] = 60.0
    guided: bool = True
    max_new_tokens: Annotated[int, Field(ge=1)] = 24
    prompt: Path | None = None


class PlannerOptions(_Options):
    """planner: one of `PLANNERS`, or "package.module:factory" for one of your own, called with `arguments`.
    text_encoder: "embedded" or "clip". clip_model: a folder, or a name on the Hugging Face hub.
    """

    planner: str = "embedded"
    arguments: dict[str, str] = {}
    embedded: EmbeddedOptions = EmbeddedOptions()
    scripted: ScriptedOptions = ScriptedOptions()
    qwen: QwenOptions = QwenOptions()
    openai: OpenAIOptions = OpenAIOptions()
    text_encoder: Literal["embedded", "clip"] = "embedded"
    clip_model: str = "openai/clip-vit-base-patch32"


PLANNERS = ("embedded", "scripted", "qwen3-vl", "openai")


def load_thinker(options: PlannerOptions) -> Thinker:
    """The planner and text encoder. Raises ValueError for options that cannot be followed, saying what to do."""
    return Thinker(_load_planner(options), load_text_encoder(options))


def load_text_encoder(options: PlannerOptions) -> TextEncoder:
    """The text encoder alone. Raises ValueError."""
    if options.text_encoder == "embedded":
        return shipped_text_encoder()
    try:
        from thinknav_server.planners.clip import ClipTextEncoder
    except ImportError as error:
        raise _not_installed("clip", error) from None
    return ClipTextEncoder(options.clip_model)


def _load_planner(options: PlannerOptions) -> Planner:
    if options.planner == "embedded":
        from thinknav_server.planners.embedded import EmbeddedPlanner

        return EmbeddedPlanner(options.embedded.weights, options.embedded.seed, options.embedded.threads)
    if options.planner == "scripted":
        chosen = options.scripted
        script = load_script(chosen.script) if chosen.script else Script()
        return ScriptedPlanner(script, chosen.latency, chosen.failure_rate, chosen.seed)
    if options.planner == "qwen3-vl":
        try:
            from thinknav_server.planners.qwen3_vl import Qwen3VLPlanner
        except ImportError as error:
            raise _not_installed("qwen3-vl", error) from None
        return Qwen3VLPlanner(options.qwen)
    return _load_foreign(options)


def _load_foreign(options: PlannerOptions) -> Planner:
    module_name, colon, name = options.planner.partition(":")
    if not colon:
        raise ValueError(
            f"there is no planner {options.planner!r}; choose {', '.join(PLANNERS)}, or name your own as "
            "package.module:factory"
        )
    sys.path.append(str(Path.cwd()))  # last, so that nothing in it hides a library
    try:
        factory = getattr(importlib.import_module(module_name), name)
        planner: Planner = factory(**options.arguments)
    except (ImportError, AttributeError, TypeError) as error:
        raise ValueError(f"cannot make the planner {options.planner!r}: {error}") from error
    return planner


def _not_installed(what: str, error: ImportError) -> ValueError:
    return ValueError(f"{what} needs libraries that are not installed ({error}); pip install 'thinknav[server,vlm]'")
