"""The command line's options of the planner, of what it runs in, and of the log."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from thinknav_server.cli_sections import takes
from thinknav_server.hosts.process import ProcessSettings
from thinknav_server.logs import LogFormat, LogLevel
from thinknav_server.planners.options import (
    PLANNERS,
    EmbeddedOptions,
    OpenAIOptions,
    PlannerOptions,
    QwenOptions,
    ScriptedOptions,
)

_SCRIPTED = ScriptedOptions()
_QWEN = QwenOptions()
_OPENAI = OpenAIOptions()
_PROCESS = ProcessSettings()
# What sockets take for a time-out, and more than anybody waits.
_LONGEST_LIMIT_S = 1_000_000


class Decode(StrEnum):
    """What a word of Qwen3-VL is generated over: `qwen_decoding` says more."""

    DYNAMIC = "dynamic"
    STATIC = "static"
    COMPILED = "compiled"


class TextEncoderName(StrEnum):
    """The text encoders that can be served."""

    EMBEDDED = "embedded"
    CLIP = "clip"


def vlm_options(
    model: Annotated[
        str, typer.Option(help="qwen3-vl: a folder, or a name on the Hugging Face hub; any size.")
    ] = _QWEN.model,
    device: Annotated[str, typer.Option(help="qwen3-vl: auto, cpu, cuda or cuda:1.")] = _QWEN.device,
    decode: Annotated[
        Decode,
        typer.Option(
            help="qwen3-vl: over a cache that grows, one of fixed size, or compiled (CUDA; loads for minutes)."
        ),
    ] = Decode.DYNAMIC,
    decode_rows: Annotated[
        int, typer.Option(min=1, help="qwen3-vl: requests generated at once, over a cache of fixed size.")
    ] = _QWEN.decode_rows,
    upstream_url: Annotated[str, typer.Option(help="openai: the server, up to and with /v1.")] = _OPENAI.url,
    upstream_model: Annotated[
        str, typer.Option(help="openai: one that it serves; none takes the only one.")
    ] = _OPENAI.model,
    upstream_key_env: Annotated[
        str, typer.Option(help="openai: the environment variable that holds the key.")
    ] = _OPENAI.key_env,
    upstream_concurrency: Annotated[
        int, typer.Option(min=1, help="openai: calls to the server at once.")
    ] = _OPENAI.concurrency,
    upstream_timeout: Annotated[float, typer.Option(min=0.001, help="openai: seconds for a call.")] = _OPENAI.timeout,
    guided: Annotated[
        bool, typer.Option(help="openai: have the server keep to a JSON schema, if it can.")
    ] = _OPENAI.guided,
    prompt: Annotated[
        Path | None, typer.Option(help="qwen3-vl, openai: YAML file with other words than the built-in ones.")
    ] = None,
    max_new_tokens: Annotated[
        int, typer.Option(min=1, help="qwen3-vl, openai: tokens of one instruction.")
    ] = _QWEN.max_new_tokens,
) -> tuple[QwenOptions, OpenAIOptions]:
    """The vision-language models: one that is loaded, and one that somebody else serves."""
    qwen = QwenOptions(
        model=model,
        device=device,
        decode=decode.value,
        decode_rows=decode_rows,
        max_new_tokens=max_new_tokens,
        prompt=prompt,
    )
    openai = OpenAIOptions(
        url=upstream_url,
        model=upstream_model,
        key_env=upstream_key_env,
        concurrency=upstream_concurrency,
        timeout=upstream_timeout,
        guided=guided,
        max_new_tokens=max_new_tokens,
        prompt=prompt,
    )
    return qwen, openai


@takes(vlms=vlm_options)
def planner_options(
    planner: Annotated[
        str, typer.Option(help=f"Who plans: {', '.join(PLANNERS)}, or one of your own as package.module:factory.")
    ] = PlannerOptions().planner,
    argument: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="For a planner of your own; may be repeated.")
    ] = None,
    weights: Annotated[
        Path | None, typer.Option(help="embedded: a file of `thinknav models train subgoal`; default: the shipped one.")
    ] = None,
    threads: Annotated[
        int, typer.Option(min=1, help="embedded: that a batch is worked on with.")
    ] = EmbeddedOptions().threads,
    script: Annotated[Path | None, typer.Option(help="scripted: YAML or JSON file with the sentences.")] = None,
    latency: Annotated[float, typer.Option(min=0, help="scripted: seconds that each batch takes.")] = _SCRIPTED.latency,
    failure_rate: Annotated[
        float, typer.Option(min=0, max=1, help="scripted: share of requests that fail.")
    ] = _SCRIPTED.failure_rate,
    seed: Annotated[int, typer.Option(help="embedded, scripted: of what is drawn.")] = _SCRIPTED.seed,
    text_encoder: Annotated[
        TextEncoderName, typer.Option(help="Whose embeddings the subgoals get.")
    ] = TextEncoderName.EMBEDDED,
    clip_model: Annotated[
        str, typer.Option(help="clip: a folder, or a name on the Hugging Face hub.")
    ] = PlannerOptions().clip_model,
    *,
    vlms: tuple[QwenOptions, OpenAIOptions],
) -> PlannerOptions:
    """Which planner, and how."""
    qwen, openai = vlms
    return PlannerOptions(
        planner=planner,
        arguments=_arguments(argument or []),
        embedded=EmbeddedOptions(weights=weights, seed=seed, threads=threads),
        scripted=ScriptedOptions(script=script, latency=latency, failure_rate=failure_rate, seed=seed),
        qwen=qwen,
        openai=openai,
        text_encoder=text_encoder.value,
        clip_model=clip_model,
    )


def process_settings(
    planner_limit: Annotated[
        float, typer.Option(min=0.001, help="Seconds for a batch, after which the planner's process is replaced.")
    ] = _PROCESS.limit,
    load_limit: Annotated[
        float, typer.Option(min=0.001, help="Seconds that loading the planner may take.")
    ] = _PROCESS.load_limit,
    log_level: Annotated[LogLevel, typer.Option(help="How much the log tells.")] = _PROCESS.log_level,
    log_format: Annotated[LogFormat, typer.Option(help="Lines for people, or JSON.")] = _PROCESS.log_format,
) -> ProcessSettings:
    """The planner's process, and the log."""
    for name, limit in (("--planner-limit", planner_limit), ("--load-limit", load_limit)):
        if not limit <= _LONGEST_LIMIT_S:
            raise typer.BadParameter(f"{name} takes at most {_LONGEST_LIMIT_S} seconds, not {limit:g}")
    return ProcessSettings(planner_limit, load_limit, log_level, log_format)


def _arguments(given: list[str]) -> dict[str, str]:
    pairs = [argument.partition("=") for argument in given]
    for name, equals, _ in pairs:
        if not (name.isidentifier() and equals):
            raise typer.BadParameter(f"--argument reads name=value, not {name + equals!r}")
    return {name: value for name, _, value in pairs}
