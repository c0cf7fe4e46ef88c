"""Qwen3-VL through transformers: batches of frames and goals to short instructions, on CUDA or the CPU.

Works without torchvision, which transformers' own Qwen3-VL processor needs: frames are cut into patches in
`qwen_patches`, and the text is laid out here with as many image tokens as there are patches.
"""

import logging
from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor
from transformers import AutoTokenizer, Qwen3VLForConditionalGeneration
from transformers.utils import logging as transformers_logging

from thinknav_proto import PlannerError
from thinknav_server.planners.base import Plan, PlanItem, PlannerIdentity
from thinknav_server.planners.options import QwenOptions
from thinknav_server.planners.prompt import PLAN_LENGTH, load_prompt, plan_from_text
from thinknav_server.planners.qwen_decoding import Decoder
from thinknav_server.planners.qwen_patches import PatchMaker
from thinknav_server.planners.snapshot import find_snapshot, model_name, revision_of

logger = logging.getLogger(__name__)

_IMAGE_TOKEN = "<|image_pad|>"
_IMAGE_MARK = f"<|vision_start|>{_IMAGE_TOKEN}<|vision_end|>"
_SIZE = 256  # pixels of the frame with which a loaded model is warmed up

# What the chat template of Qwen's checkpoints comes to for messages of text and images. Laid out here, a goal that
# comes from outside can be kept from speaking in the template's own marks.
_TURN = "<|im_start|>{role}\n{content}<|im_end|>\n"


class Qwen3VLPlanner:
    """Greedy at temperature 0, sampling above it. Raises ValueError for a model that cannot be loaded."""

    def __init__(self, options: QwenOptions) -> None:
        transformers_logging.disable_progress_bar()
        self._options = options
        self._prompt = load_prompt(options.prompt)
        snapshot = find_snapshot(options.model)
        self.device = torch.device(_device(options.device))
        dtype = torch.bfloat16 if self.device.type == "cuda" else torch.float32
        try:
            self._tokenizer = AutoTokenizer.from_pretrained(snapshot, padding_side="left")
            self._patches = PatchMaker.of(snapshot, self.device)
            model = Qwen3VLForConditionalGeneration.from_pretrained(snapshot, dtype=dtype)
        except (OSError, ValueError, KeyError) as error:
            raise ValueError(f"{snapshot} holds no Qwen3-VL model that can be used: {error}") from error
        self.model = model.to(self.device).eval()
        self.decoder = Decoder(self.model, options.decode, options.decode_rows)
        self._identity = PlannerIdentity(
            f"qwen3-vl/{model_name(options.model)}", revision_of(snapshot), self._prompt.hash
        )
        for size in self.decoder.warm_up_sizes:  # so that nobody waits for kernels
            self.plan([PlanItem(np.zeros((_SIZE, _SIZE, 3), np.uint8), "chair")] * size)
        logger.info("%s is on %s in %s", snapshot, self.device, dtype)

    @property
    def identity(self) -> PlannerIdentity:
        return self._identity

    def plan(self, items: Sequence[PlanItem]) -> Sequence[Plan | PlannerError]:
        answers: dict[int, Plan | PlannerError] = {}
        alike: dict[tuple[str, float], list[int]] = defaultdict(list)
        for index, item in enumerate(items):
            alike[item.mode, item.temperature].append(index)
        for (mode, temperature), indices in alike.items():
            asked = [items[index] for index in indices]
            tokens = self._options.max_new_tokens * (PLAN_LENGTH if mode == "plan" else 1)
            texts = self._generate(asked, temperature, tokens)
            answers |= {i: plan_from_text(text, item) for i, text, item in zip(indices, texts, asked, strict=True)}
        return [answers[index] for index in range(len(items))]

    def encode(self, items: Sequence[PlanItem]) -> dict[str, Tensor]:
        """The model's inputs for a batch, padded on the left."""
        frames, texts = [], []
        for item in items:
            content = ""
            for part in self._prompt.parts(item):
                if isinstance(part, str):
                    content += _without_marks(part)
                else:
                    patches, tokens = self._patches.cut(part)
                    frames.append(patches)
                    content += _IMAGE_MARK.replace(_IMAGE_TOKEN, _IMAGE_TOKEN * tokens)
            system = _TURN.format(role="system", content=_without_marks(self._prompt.system))
            texts.append(system + _TURN.format(role="user", content=content) + "<|im_start|>assistant\n")
        multiple = self.decoder.prompt_multiple
        tokenized = self._tokenizer(texts, padding=True, pad_to_multiple_of=multiple, return_tensors="pt")
        ids = tokenized["input_ids"].to(self.device)
        image_token = self._tokenizer.convert_tokens_to_ids(_IMAGE_TOKEN)
        return {
            "input_ids": ids,
            "attention_mask": tokenized["attention_mask"].to(self.device),
            "mm_token_type_ids": (ids == image_token).int(),
            "pixel_values": torch.cat([frame.pixels for frame in frames]),
            "image_grid_thw": torch.tensor([frame.grid for frame in frames], device=self.device),
        }

    @torch.inference_mode()
    def logits(self, items: Sequence[PlanItem]) -> Tensor:
        """(N, vocabulary) of the first word that each answer would have."""
        logits: Tensor = self.model(**self.encode(items)).logits[:, -1]
        return logits

    def _generate(self, items: Sequence[PlanItem], temperature: float, max_new_tokens: int) -> list[str]:
        # The checkpoint's own top-k and top-p hold for sampling, and must not be named without it.
        drawn = temperature >= _LOWEST_TEMPERATURE
        sampling = {"do_sample": True, "temperature": temperature} if drawn else GREEDY
        texts: list[str] = []
        for part in self.decoder.parts(items):
            new = self.decoder.generate(self.encode(part.items), max_new_tokens, sampling)
            texts += self._tokenizer.batch_decode(new[: part.wanted], skip_special_tokens=True)
        return texts


# Below it the likeliest words are drawn anyway, and logits over so little are infinite, which ends a GPU's process.
_LOWEST_TEMPERATURE = 0.01
GREEDY = {"do_sample": False, "temperature": None, "top_p": None, "top_k": None}


def _device(wanted: str) -> str:
    if wanted != "auto":
        return wanted
    return "cuda" if torch.cuda.is_available() else "cpu"


def _without_marks(text: str) -> str:
    """A goal comes from outside: it must not be able to end the turn or to claim an image."""
    return text.replace("<|", "< |")
