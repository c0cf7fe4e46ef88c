"""Tiny random models, each written once for all tests."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def qwen_checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny random Qwen3-VL on disk."""
    from tests.server.tiny_models import write_qwen3_vl

    return write_qwen3_vl(tmp_path_factory.mktemp("models") / "tiny-qwen")


@pytest.fixture(scope="session")
def clip_checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny random CLIP text encoder on disk."""
    from tests.server.tiny_models import write_clip_text

    return write_clip_text(tmp_path_factory.mktemp("models") / "tiny-clip")
