"""The planner `qwen3-vl` on this machine: a model of full size with random weights, alone and behind the service.

Alone, batches are taken apart: making a batch of frames and words, reading it, and each word after that. How many bytes
and sums a second that comes to says what limits it: where both are far below what the processor can do, it is the calls
that start the work.
"""

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from thinknav_proto import Frame
from thinknav_server.bench.figures import Figure
from thinknav_server.bench.load import closed_loop
from thinknav_server.bench.random_qwen import write_random_qwen
from thinknav_server.bench.servers import jpegs, our_requests, service_with
from thinknav_server.images import decode_frame
from thinknav_server.planners import PlanItem
from thinknav_server.planners.options import QwenOptions
from thinknav_server.planners.qwen3_vl import GREEDY, Qwen3VLPlanner
from thinknav_server.planners.qwen_decoding import Decode

WORDS = 12
_REPETITIONS = 5
_START_S = 1800.0  # compiling takes its time


@dataclass(frozen=True)
class VlmSetup:
    """size: one of `SIZES`. device: "auto" takes CUDA where there is one. clients: how many ask at once, in turns.
    seconds: of each measurement behind the service.
    """

    size: str
    device: str
    decodes: Sequence[Decode]
    clients: Sequence[int]
    max_batch: int
    seconds: float


def vlm_figures(setup: VlmSetup) -> Iterator[Figure]:
    """Each as soon as it is measured. Raises ValueError for what the machine cannot do."""
    frames = jpegs()
    with tempfile.TemporaryDirectory() as folder:
        drawn_on = "cuda" if setup.device != "cpu" and torch.cuda.is_available() else "cpu"
        model = write_random_qwen(Path(folder) / f"random-qwen3-vl-{setup.size}", setup.size, torch.device(drawn_on))
        for decode in setup.decodes:
            name = f"qwen3_vl.{setup.size}.{decode}"
            options = QwenOptions(
                model=str(model),
                device=setup.device,
                decode=decode,
                decode_rows=setup.max_batch,
                max_new_tokens=WORDS,
            )
            offline: dict[int, float] = {}
            for figure in _alone(name, options, setup, frames):
                if figure.figure.endswith(".offline"):
                    offline[int(figure.figure.split(".b")[-1].split(".")[0])] = figure.value
                yield figure
            yield from _served(name, options, setup, frames, offline)


def _alone(name: str, options: QwenOptions, setup: VlmSetup, frames: Sequence[bytes]) -> Iterator[Figure]:
    began = time.perf_counter()
    planner = Qwen3VLPlanner(options)
    yield Figure(f"{name}.load", time.perf_counter() - began, "s, warm-up and compiling counted")
    items = [PlanItem(decode_frame(Frame(encoding="jpeg", data=data)), "chair") for data in frames]
    for size in sorted({min(clients, setup.max_batch) for clients in setup.clients}):
        yield from _taken_apart(f"{name}.b{size}", planner, items[:size])
    if planner.device.type == "cuda":
        yield Figure(f"{name}.memory", torch.cuda.max_memory_reserved(planner.device) / 1e9, "GB at most")
        del planner
        torch.cuda.empty_cache()


def _taken_apart(name: str, planner: Qwen3VLPlanner, items: Sequence[PlanItem]) -> Iterator[Figure]:
    (part,) = planner.decoder.parts(items)
    inputs = planner.encode(part.items)
    tokens, patches = int(inputs["attention_mask"].sum()), len(inputs["pixel_values"])

    def generate(words: int) -> None:
        planner.decoder.generate(inputs, words, GREEDY)

    encoding = _seconds(planner, lambda: planner.encode(part.items))
    reading = _seconds(planner, lambda: generate(1))
    saying = _seconds(planner, lambda: generate(WORDS))
    whole = _seconds(planner, lambda: planner.plan(items))
    word = max(saying - reading, 1e-9) / (WORDS - 1)
    language, vision = planner.model.model.language_model.layers, planner.model.model.visual
    sums = 2 * (_count(language) * tokens + _count(vision) * patches)
    read = sum(tensor.nbytes for part in (language, planner.model.lm_head) for tensor in part.parameters())
    yield Figure(f"{name}.encode_ms", 1000 * encoding, "ms for the batch: patches and tokens")
    yield Figure(f"{name}.read_ms", 1000 * reading, "ms for the batch: frames and prompts, up to the first word")
    yield Figure(f"{name}.word_ms", 1000 * word, "ms for the batch: each further word")
    yield Figure(f"{name}.read_tflops", sums / reading / 1e12, "TFLOP/s, two a weight and token or patch")
    yield Figure(f"{name}.word_gb_s", read / word / 1e9, "GB/s of weights read, each once a word")
    yield Figure(f"{name}.offline", len(items) / whole, "subgoals/s in batches of this size, without the service")


def _count(part: Any) -> int:
    return sum(tensor.numel() for tensor in part.parameters())


def _seconds(planner: Qwen3VLPlanner, work: Callable[[], object]) -> float:
    """The median of some repetitions, after one that does not count."""
    taken = []
    for _ in range(1 + _REPETITIONS):
        began = time.perf_counter()
        work()
        if planner.device.type == "cuda":
            torch.cuda.synchronize(planner.device)
        taken.append(time.perf_counter() - began)
    return float(np.median(taken[1:]))


def _served(
    name: str, options: QwenOptions, setup: VlmSetup, frames: list[bytes], offline: dict[int, float]
) -> Iterator[Figure]:
    command = ["--planner", "qwen3-vl", "--model", options.model, "--device", options.device]
    command += ["--decode", options.decode, "--decode-rows", str(options.decode_rows)]
    command += ["--max-new-tokens", str(WORDS), "--max-batch", str(setup.max_batch), "--cache-size", "0"]
    command += ["--queue-size", str(2 * max(setup.clients)), "--log-level", "warning"]
    command += ["--load-limit", str(_START_S)]
    with service_with(command, patience=_START_S) as (url, _):
        requests = our_requests(url, frames)
        for clients in setup.clients:
            tally = closed_loop(url, requests, clients, setup.seconds)
            best = offline[min(clients, setup.max_batch)]
            rate = tally.rate()
            unit = "subgoals/s"
            yield Figure(f"{name}.c{clients}.rate", rate, unit, "the model alone, same batch", best, rate / best)
            yield Figure(f"{name}.c{clients}.p50", tally.quantile(0.5), "ms")
            yield Figure(f"{name}.c{clients}.p99", tally.quantile(0.99), "ms")
            others = len(tally.answers) - len(tally.latencies())
            yield Figure(f"{name}.c{clients}.failed", float(others), "requests not answered with a subgoal")
