"""Random models small enough for a test, written to disk as real checkpoints are. Nothing is downloaded."""

import json
from pathlib import Path

import torch
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, processors, trainers
from transformers import (
    CLIPTextConfig,
    CLIPTextModelWithProjection,
    PreTrainedTokenizerFast,
    Qwen3VLConfig,
    Qwen3VLForConditionalGeneration,
)
from transformers.models.qwen2_vl.image_processing_pil_qwen2_vl import Qwen2VLImageProcessorPil

from thinknav_server.bench.random_qwen import MARKS

_CHAT = (
    "{% for m in messages %}<|im_start|>{{ m['role'] }}\n{% if m['content'] is string %}{{ m['content'] }}{% else %}"
    "{% for c in m['content'] %}{% if c['type'] == 'text' %}{{ c['text'] }}{% else %}"
    "<|vision_start|><|image_pad|><|vision_end|>{% endif %}{% endfor %}{% endif %}<|im_end|>\n{% endfor %}"
    "{% if add_generation_prompt %}<|im_start|>assistant\n{% endif %}"
)
_WORDS = ["turn left toward the doorway and find the chair", "system user assistant move forward stop"]


def _tokenizer(end: str) -> PreTrainedTokenizerFast:
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    alphabet = pre_tokenizers.ByteLevel.alphabet()
    trainer = trainers.BpeTrainer(
        vocab_size=400, special_tokens=list(MARKS), initial_alphabet=alphabet, show_progress=False
    )
    tokenizer.train_from_iterator(_WORDS * 5, trainer)
    return PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, eos_token=end, pad_token=MARKS[0], additional_special_tokens=list(MARKS[1:])
    )


def write_qwen3_vl(folder: Path, seed: int = 0, head_dim: int = 16, video: bool = False, spread: float = 0.02) -> Path:
    """A Qwen3-VL of a quarter of a million parameters; 256 x 256 pixels make 64 image tokens.

    head_dim, video: vLLM wants heads of 32 values; transformers' own processor wants settings for videos.
    spread: of the weights. At the usual one it says one word, whatever it is asked.
    """
    tokenizer = _tokenizer("<|im_end|>")
    number = tokenizer.convert_tokens_to_ids
    torch.manual_seed(seed)
    text = {
        "vocab_size": len(tokenizer),
        "initializer_range": spread,
        "hidden_size": 64,
        "intermediate_size": 128,
        "num_hidden_layers": 2,
        "num_attention_heads": 4,
        "num_key_value_heads": 2,
        "head_dim": head_dim,
        "max_position_embeddings": 4096,
        "rope_parameters": {
            "rope_type": "default",
            "rope_theta": 10000.0,
            "mrope_section": [head_dim // 4, head_dim // 8, head_dim // 8],
            "mrope_interleaved": True,
        },
        "eos_token_id": number("<|im_end|>"),
        "pad_token_id": number("<|endoftext|>"),
        "bos_token_id": None,
    }
    vision = {
        "initializer_range": spread,
        "depth": 2,
        "hidden_size": 32,
        "intermediate_size": 64,
        "num_heads": 4,
        "patch_size": 16,
        "spatial_merge_size": 2,
        "temporal_patch_size": 2,
        "out_hidden_size": 64,
        "num_position_embeddings": 256,
        "deepstack_visual_indexes": [0, 1],
    }
    config = Qwen3VLConfig(
        text_config=text,
        vision_config=vision,
        image_token_id=number("<|image_pad|>"),
        video_token_id=number("<|video_pad|>"),
        vision_start_token_id=number("<|vision_start|>"),
        vision_end_token_id=number("<|vision_end|>"),
        tie_word_embeddings=True,
    )
    Qwen3VLForConditionalGeneration(config).save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    image_processor().save_pretrained(folder)
    if video:
        _write_for_servers(folder)
    return folder


def _write_for_servers(folder: Path) -> None:
    """What servers read besides: which processor to make, settings for videos, how to lay out a chat and to sample."""
    settings = {"image_processor_type": "Qwen2VLImageProcessor", "processor_class": "Qwen3VLProcessor"}
    for name, more in (
        ("preprocessor_config.json", settings),
        ("video_preprocessor_config.json", {"video_processor_type": "Qwen3VLVideoProcessor"}),
    ):
        values = image_processor().to_dict() | more
        (folder / name).write_text(json.dumps(values))
    (folder / "chat_template.jinja").write_text(_CHAT)
    # As Qwen's own checkpoints have it: without, `transformers serve` never samples, whatever the temperature.
    sampling = folder / "generation_config.json"
    sampling.write_text(json.dumps(json.loads(sampling.read_text()) | {"do_sample": True, "temperature": 0.7}))


def image_processor() -> Qwen2VLImageProcessorPil:
    """Of the model above."""
    return Qwen2VLImageProcessorPil(
        patch_size=16,
        merge_size=2,
        temporal_patch_size=2,
        size={"shortest_edge": 64 * 64, "longest_edge": 256 * 256},
        image_mean=[0.5, 0.4, 0.3],
        image_std=[0.5, 0.6, 0.7],
    )


def write_clip_text(folder: Path) -> Path:
    """A CLIP text encoder of 32 values a word and 512 in the end."""
    tokenizer = _tokenizer("<|endoftext|>")
    tokenizer.backend_tokenizer.post_processor = processors.TemplateProcessing(
        single="$A <|endoftext|>", special_tokens=[("<|endoftext|>", 0)]
    )
    torch.manual_seed(0)
    config = CLIPTextConfig(
        vocab_size=len(tokenizer),
        hidden_size=32,
        intermediate_size=64,
        num_hidden_layers=2,
        num_attention_heads=2,
        projection_dim=512,
        max_position_embeddings=77,
        bos_token_id=None,
        eos_token_id=tokenizer.eos_token_id,
        pad_token_id=tokenizer.pad_token_id,
    )
    CLIPTextModelWithProjection(config).save_pretrained(folder)
    tokenizer.save_pretrained(folder)
    return folder
