"""The ways to decode say the same words; batches are filled up and cut, and what they are filled with is not told."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from transformers import CompileConfig

from tests.server.tiny_models import write_qwen3_vl
from thinknav_server.planners import PlanItem
from thinknav_server.planners.options import QwenOptions
from thinknav_server.planners.qwen3_vl import Qwen3VLPlanner
from thinknav_server.planners.qwen_decoding import Decoder

GREEDY: dict[str, Any] = {"do_sample": False, "temperature": None, "top_p": None, "top_k": None, "min_new_tokens": 6}
ITEMS = [
    PlanItem(np.random.default_rng(seed).integers(0, 256, (64, 64, 3), dtype=np.uint8), goal)
    for seed, goal in enumerate(("chair", "potted plant in the living room", "bed", "sofa", "toilet"))
]


def planner_of(checkpoint: Path, **options: Any) -> Qwen3VLPlanner:
    return Qwen3VLPlanner(QwenOptions(model=str(checkpoint), max_new_tokens=6, **options))


def words(planner: Qwen3VLPlanner, decoder: Decoder, items: Sequence[PlanItem]) -> list[list[int]]:
    tokens: list[list[int]] = []
    for part in decoder.parts(items):
        tokens += decoder.generate(planner.encode(part.items), 6, GREEDY)[: part.wanted].tolist()
    return tokens


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One that says something else to each question."""
    return write_qwen3_vl(tmp_path_factory.mktemp("models") / "talkative-qwen", spread=0.3)


@pytest.fixture(scope="module")
def dynamic(checkpoint: Path) -> Qwen3VLPlanner:
    return planner_of(checkpoint)


@pytest.fixture(scope="module")
def static(checkpoint: Path) -> Qwen3VLPlanner:
    return planner_of(checkpoint, decode="static", decode_rows=4)


@pytest.mark.parametrize("count", [1, 3, 5])
def test_a_cache_of_fixed_size_changes_no_word(dynamic: Qwen3VLPlanner, static: Qwen3VLPlanner, count: int) -> None:
    expected = words(dynamic, dynamic.decoder, ITEMS[:count])
    assert len(expected) == count
    assert len({tuple(row) for row in expected}) == count, "a test that could not tell them apart"
    for _ in range(2):  # the second time over the same cache
        assert words(static, static.decoder, ITEMS[:count]) == expected
    assert str(static.plan(ITEMS[:count])) == str(dynamic.plan(ITEMS[:count]))


def test_prompts_and_batches_have_few_shapes(static: Qwen3VLPlanner) -> None:
    parts = list(static.decoder.parts(ITEMS * 2))
    assert [(len(part.items), part.wanted) for part in parts] == [(4, 4), (4, 4), (2, 2)]
    assert [(len(p.items), p.wanted) for p in static.decoder.parts(ITEMS[:3])] == [(4, 3)]
    inputs = static.encode(parts[0].items)
    assert inputs["input_ids"].shape[1] % 64 == 0
    assert len(set(inputs["attention_mask"].sum(1).tolist())) > 1


def test_caches_are_used_again_and_bounded(static: Qwen3VLPlanner) -> None:
    decoder = static.decoder
    first = decoder._cache(4, 128)
    for length in range(200, 220):
        decoder._cache(4, length)
        assert decoder._cache(4, 128) is first  # asked for last, kept longest
    assert len(decoder._caches) == 8


def test_compiled_words_are_the_same(dynamic: Qwen3VLPlanner, static: Qwen3VLPlanner) -> None:
    """By dynamo alone, without the compiler behind it, which takes minutes."""
    config = CompileConfig(backend="eager", mode=None)
    config._compile_all_devices = True
    decoder = Decoder(static.model, "compiled", 4, config)
    torch._dynamo.utils.counters.clear()
    assert words(static, decoder, ITEMS[:4]) == words(dynamic, dynamic.decoder, ITEMS[:4])
    counters = torch._dynamo.utils.counters
    assert counters["stats"]["unique_graphs"] == 1
    assert not counters["graph_break"]
    assert words(static, decoder, ITEMS[1:4]) == words(dynamic, dynamic.decoder, ITEMS[1:4])  # three, filled up
    assert counters["stats"]["unique_graphs"] == 1
    torch._dynamo.reset()


def test_compiling_is_refused_where_it_does_not_pay(checkpoint: Path, static: Qwen3VLPlanner) -> None:
    with pytest.raises(ValueError, match="compiled pays on CUDA alone, and the model is on cpu"):
        planner_of(checkpoint, decode="compiled")
    assert Decoder(static.model, "compiled", 48, CompileConfig()).warm_up_sizes == [1, 2, 4, 8, 16, 32, 64]
