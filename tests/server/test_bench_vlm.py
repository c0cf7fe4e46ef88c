"""The model that `bench vlm` draws is what it says, and the figures come out; how fast it is is not for a test."""

import itertools
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
import torch
from transformers import Qwen3VLForConditionalGeneration

from thinknav_server.bench import vlm
from thinknav_server.bench.load import Tally
from thinknav_server.bench.random_qwen import qwen_config, write_random_qwen
from thinknav_server.planners import Plan, PlanItem
from thinknav_server.planners.options import QwenOptions
from thinknav_server.planners.qwen3_vl import GREEDY, Qwen3VLPlanner

WEIGHTS_OF_QWEN3_VL_2B = 2_127_532_032  # 2.1 billion: of the published shapes, the tied last layer counted once


def test_the_full_size_is_that_of_the_real_model() -> None:
    with torch.device("meta"):
        model = Qwen3VLForConditionalGeneration(qwen_config("2b"))
    weights = sum(tensor.numel() for tensor in model.parameters())
    assert weights - model.lm_head.weight.numel() == WEIGHTS_OF_QWEN3_VL_2B
    assert model.lm_head.weight.shape == model.get_input_embeddings().weight.shape


def test_every_answer_has_all_its_words(tmp_path: Path) -> None:
    model = write_random_qwen(tmp_path / "tiny", "tiny", torch.device("cpu"))
    planner = Qwen3VLPlanner(QwenOptions(model=str(model), device="cpu", max_new_tokens=12))
    random = np.random.default_rng(0)
    items = [PlanItem(random.integers(0, 256, (256, 256, 3), dtype=np.uint8), "chair") for _ in range(3)]
    inputs = planner.encode(items)
    assert inputs["mm_token_type_ids"].sum(1).tolist() == [64, 64, 64]
    assert 64 + 60 < inputs["input_ids"].shape[1] < 64 + 160  # a word is a token
    assert planner.decoder.generate(inputs, 12, GREEDY).shape == (3, 12)
    for plan in planner.plan(items):
        assert isinstance(plan, Plan)
        assert plan.instructions[0].startswith("word")


def test_the_figures_alone_and_behind_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def ten(url: str, requests: Sequence[bytes], clients: int, seconds: float) -> Tally:
        asked.append(clients)
        tally = Tally(seconds=seconds)
        for request in itertools.islice(requests, 10):
            head, _, body = request.partition(b"\r\n\r\n")
            fields = dict(line.split(": ", 1) for line in head.decode().split("\r\n")[1:])
            assert fields["Host"] == urlsplit(url).netloc
            headers = {"Content-Type": fields["Content-Type"]}
            answer = httpx.post(f"{url}/v1/subgoals", content=body, headers=headers, trust_env=False, timeout=60)
            tally.answers.append((0.5, answer.status_code))
        return tally

    monkeypatch.setattr(vlm, "closed_loop", ten)
    monkeypatch.setattr(vlm, "_REPETITIONS", 1)
    setup = vlm.VlmSetup("tiny", "cpu", ["static"], (1, 3), max_batch=2, seconds=1.0)
    figures = {figure.figure: figure for figure in vlm.vlm_figures(setup)}
    assert asked == [1, 3]
    name = "qwen3_vl.tiny.static"
    assert figures[f"{name}.load"].value > 0
    for clients, size in ((1, 1), (3, 2)):
        rate = figures[f"{name}.c{clients}.rate"]
        assert rate.value == 10
        assert rate.peer_value == figures[f"{name}.b{size}.offline"].value
        assert figures[f"{name}.c{clients}.failed"].value == 0
        assert figures[f"{name}.c{clients}.p50"].value == 500
        stages = ("encode_ms", "read_ms", "word_ms", "read_tflops", "word_gb_s")
        assert all(figures[f"{name}.b{size}.{stage}"].value > 0 for stage in stages)
