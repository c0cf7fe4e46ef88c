"""A Qwen3-VL with random weights, written to disk as a real checkpoint is: its shapes, and so its cost, and no sense.

Nothing is downloaded. What differs from the real one: words come from a tokenizer that was trained on the prompt alone,
where a word is a token, as most are in the real one; and the last layer has weights of its own instead of the
embedding's, so that it never says a token that ends the answer or holds no letters. Each answer has all the tokens that
it may have.
"""

import json
from pathlib import Path
from typing import Any

import torch
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import PreTrainedTokenizerFast, Qwen3VLConfig, Qwen3VLForConditionalGeneration

from thinknav_server.planners.prompt import load_prompt

MARKS = (
    "<|endoftext|>",
    "<|im_start|>",
    "<|im_end|>",
    "<|vision_start|>",
    "<|vision_end|>",
    "<|image_pad|>",
    "<|video_pad|>",
)
_LEARNT = 1000  # tokens at most that are learnt from the prompt; the rest of the vocabulary is made up

# As in the configuration of Qwen/Qwen3-VL-2B-Instruct, and a toy of the same kind.
SIZES: dict[str, dict[str, dict[str, Any]]] = {
    "2b": {
        "text": {
            "vocab_size": 151_936,
            "hidden_size": 2048,
            "intermediate_size": 6144,
            "num_hidden_layers": 28,
            "num_attention_heads": 16,
            "num_key_value_heads": 8,
            "head_dim": 128,
            "max_position_embeddings": 262_144,
        },
        "vision": {
            "depth": 24,
            "hidden_size": 1024,
            "intermediate_size": 4096,
            "num_heads": 16,
            "out_hidden_size": 2048,
            "num_position_embeddings": 2304,
            "deepstack_visual_indexes": [5, 11, 17],
        },
    },
    "tiny": {
        "text": {
            "vocab_size": 2000,
            "hidden_size": 64,
            "intermediate_size": 128,
            "num_hidden_layers": 2,
            "num_attention_heads": 4,
            "num_key_value_heads": 2,
            "head_dim": 32,
            "max_position_embeddings": 4096,
        },
        "vision": {
            "depth": 2,
            "hidden_size": 32,
            "intermediate_size": 64,
            "num_heads": 4,
            "out_hidden_size": 64,
            "num_position_embeddings": 256,
            "deepstack_visual_indexes": [0, 1],
        },
    },
}
_PATCHES = {
    "patch_size": 16,
    "merge_size": 2,
    "temporal_patch_size": 2,
    "size": {"shortest_edge": 65_536, "longest_edge": 16_777_216},
    "image_mean": [0.5, 0.5, 0.5],
    "image_std": [0.5, 0.5, 0.5],
}


def qwen_config(size: str) -> Qwen3VLConfig:
    """size: one of `SIZES`. Marks are the first tokens, as `write_random_qwen` has them."""
    shapes = SIZES[size]
    head = shapes["text"]["head_dim"]
    rope = {
        "rope_type": "default",
        "rope_theta": 5_000_000.0,
        "mrope_section": [head // 2 - 2 * (head * 5 // 32), head * 5 // 32, head * 5 // 32],
        "mrope_interleaved": True,
    }
    ends = {"eos_token_id": MARKS.index("<|im_end|>"), "pad_token_id": 0, "bos_token_id": None}
    return Qwen3VLConfig(
        text_config={**shapes["text"], "rope_parameters": rope, **ends},
        vision_config={**shapes["vision"], "patch_size": 16, "spatial_merge_size": 2, "temporal_patch_size": 2},
        image_token_id=MARKS.index("<|image_pad|>"),
        video_token_id=MARKS.index("<|video_pad|>"),
        vision_start_token_id=MARKS.index("<|vision_start|>"),
        vision_end_token_id=MARKS.index("<|vision_end|>"),
        tie_word_embeddings=False,
    )


def write_random_qwen(folder: Path, size: str, device: torch.device) -> Path:
    """The folder of a checkpoint. device: where the weights are drawn."""
    config = qwen_config(size)
    tokenizer, learnt = _tokenizer(config.text_config.vocab_size)
    torch.manual_seed(0)
    usual = torch.get_default_dtype()
    torch.set_default_dtype(torch.bfloat16)
    try:
        with torch.device(device):
            model = Qwen3VLForConditionalGeneration(config)
    finally:
        torch.set_default_dtype(usual)
    with torch.no_grad():
        model.lm_head.weight[:learnt] = 0  # some other token is always likelier
    model.save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    (folder / "preprocessor_config.json").write_text(json.dumps(_PATCHES))
    return folder


def _tokenizer(vocabulary: int) -> tuple[PreTrainedTokenizerFast, int]:
    """With as many tokens, and how many of them were learnt."""
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    trainer = trainers.BpeTrainer(
        vocab_size=_LEARNT,
        special_tokens=list(MARKS),
        initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
        show_progress=False,
    )
    words = [*load_prompt(None).model_dump().values(), "system user assistant chair"]
    tokenizer.train_from_iterator(words * 4, trainer)
    content = json.loads(tokenizer.to_str())
    entries = content["model"]["vocab"]
    learnt = len(entries)
    entries.update({f"Ġword{number}": number for number in range(learnt, vocabulary)})
    return PreTrainedTokenizerFast(
        tokenizer_object=Tokenizer.from_str(json.dumps(content)),
        eos_token="<|im_end|>",
        pad_token=MARKS[0],
        additional_special_tokens=list(MARKS[1:]),
    ), learnt
