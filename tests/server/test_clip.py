"""CLIP's text encoder over a tiny random model."""

from pathlib import Path

import numpy as np
import pytest

from thinknav_server.planners.clip import ClipTextEncoder
from thinknav_server.planners.options import PlannerOptions, load_text_encoder


def test_texts_become_unit_vectors_whatever_stands_beside_them(clip_checkpoint: Path) -> None:
    encoder = ClipTextEncoder(str(clip_checkpoint))
    texts = ["find a chair", "turn left toward the doorway", "stop", "long " * 200]
    together = encoder.encode(texts)
    assert together.shape == (4, encoder.dimension) == (4, 512)
    assert together.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(together, axis=1), 1, rtol=1e-5)
    alone = np.concatenate([encoder.encode([text]) for text in texts])
    np.testing.assert_allclose(together, alone, atol=1e-5)
    assert np.abs(together[0] - together[1]).max() > 1e-3
    assert encoder.encode([]).shape == (0, 512)


def test_its_space_names_its_weights(clip_checkpoint: Path) -> None:
    options = PlannerOptions(text_encoder="clip", clip_model=str(clip_checkpoint))
    encoder = load_text_encoder(options)
    assert encoder.space == ClipTextEncoder(str(clip_checkpoint)).space
    assert encoder.space.name == "clip/tiny-clip"


def test_a_folder_without_a_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="holds no CLIP text encoder"):
        ClipTextEncoder(str(tmp_path))
