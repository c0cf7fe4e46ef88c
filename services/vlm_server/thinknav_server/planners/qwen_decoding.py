"""How a Qwen3-VL puts words after a prompt: over a cache that grows with them, one of fixed size, or compiled.

What takes the time of a small batch on a GPU is not the model but the calls that start its thousand kernels a word.
Compiled code starts them as one CUDA graph, which holds for one shape and one place in memory: so batches are filled up
to a power of two, prompts to a multiple of 64 tokens, and caches are kept and used again. Knows nothing of frames.
"""

from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeVar

import torch
from torch import Tensor
from transformers import CompileConfig, StaticCache

Decode = Literal["dynamic", "static", "compiled"]

_PROMPT_MULTIPLE = 64
_CACHES = 8  # that are kept: those of all batch sizes up to 128

Item = TypeVar("Item")


class Part(NamedTuple):
    """Some items of a batch, filled up with the first of them; only as many answers as are `wanted` are used."""

    items: list[Any]
    wanted: int


class Decoder:
    """dynamic: as transformers does by itself. rows: of one batch at most; a larger one is generated in parts.

    compile_config: for "compiled"; transformers' own unless given. Raises ValueError for "compiled" without CUDA, where
    compiling takes minutes and the result is slower.
    """

    def __init__(self, model: Any, mode: Decode, rows: int, compile_config: CompileConfig | None = None) -> None:
        if mode == "compiled" and compile_config is None and model.device.type != "cuda":
            raise ValueError(f"--decode compiled pays on CUDA alone, and the model is on {model.device}")
        self._model = model
        self._mode = mode
        self._rows = rows
        self._compile_config = compile_config
        self._caches: OrderedDict[tuple[int, int], StaticCache] = OrderedDict()

    @property
    def prompt_multiple(self) -> int | None:
        """Tokens of which the length of a batch of prompts must be a multiple."""
        return None if self._mode == "dynamic" else _PROMPT_MULTIPLE

    @property
    def warm_up_sizes(self) -> list[int]:
        """Sizes of batches that must be generated once before nobody waits for compilers and kernels."""
        if self._mode != "compiled":
            return [1]
        return [1 << power for power in range(_filled(self._rows).bit_length())]

    def parts(self, items: Sequence[Item]) -> Iterator[Part]:
        """The items, in the sizes that they are to be encoded and generated in."""
        if self._mode == "dynamic":
            yield Part(list(items), len(items))
            return
        for start in range(0, len(items), self._rows):
            part = list(items[start : start + self._rows])
            yield Part(part + part[:1] * (_filled(len(part)) - len(part)), len(part))

    @torch.inference_mode()
    def generate(self, inputs: Mapping[str, Tensor], max_new_tokens: int, sampling: Mapping[str, Any]) -> Tensor:
        """(N, new tokens) that follow the prompts in `inputs`, which are padded on the left."""
        rows, length = inputs["input_ids"].shape
        how: dict[str, Any] = {}
        if self._mode != "dynamic":
            how["past_key_values"] = self._cache(rows, length + max_new_tokens)
            how["disable_compile"] = self._mode == "static"
        if self._mode == "compiled" and self._compile_config is not None:
            how["compile_config"] = self._compile_config
        generated: Tensor = self._model.generate(**inputs, max_new_tokens=max_new_tokens, **sampling, **how)
        return generated[:, length:]

    def _cache(self, rows: int, length: int) -> StaticCache:
        """An empty one, in the same place in memory as the last of this size."""
        cache = self._caches.pop((rows, length), None)
        if cache is None:
            cache = StaticCache(config=self._model.config.get_text_config(decoder=True), max_cache_len=length)
        elif cache.is_initialized:
            cache.reset()
        self._caches[rows, length] = cache
        if len(self._caches) > _CACHES:
            self._caches.popitem(last=False)
        return cache


def _filled(count: int) -> int:
    """The next power of two."""
    return 1 << (count - 1).bit_length()
