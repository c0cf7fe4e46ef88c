"""The image half of the small CLIP, and what is nearest to a frame."""

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from thinknav_models.clip import shipped_text_encoder
from thinknav_models.clip.image import FRAME_SIZE, SMALL_KIND, SMALL_WEIGHTS, ClipImageEncoder, resampled
from thinknav_models.clip.nearest import nearest, stock_sentences
from thinknav_models.clip.text import CLIP_WEIGHTS, ClipTextEncoder
from thinknav_models.weights import WeightsError, load_weights, save_weights

VIEWS = Path(__file__).parents[2] / "docs" / "images"  # ten frames of homes


def frames(count: int, height: int = FRAME_SIZE, width: int = FRAME_SIZE) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    coarse = torch.rand(count, 3, 8, 8, generator=generator)
    smooth = torch.nn.functional.interpolate(coarse, (height, width), mode="bilinear")
    return (smooth.permute(0, 2, 3, 1) * 255).to(torch.uint8)


def test_embeddings_are_unit_vectors_made_of_features() -> None:
    encoder = ClipImageEncoder.load()
    features = encoder.features(frames(5))
    assert features.shape == (5, encoder.feature_size)
    assert features.dtype == torch.float16
    assert torch.isfinite(features).all()
    embeddings = encoder.embed(features)
    torch.testing.assert_close(embeddings, encoder.encode(frames(5)))
    torch.testing.assert_close(embeddings.norm(dim=1), torch.ones(5))
    assert encoder.features(frames(0)).shape == (0, encoder.feature_size)
    assert encoder.space == shipped_text_encoder().space


def test_bfloat16_sees_what_float32_sees() -> None:
    exact = ClipImageEncoder.load(dtype=torch.float32).encode(frames(4))
    rounded = ClipImageEncoder.load(dtype=torch.bfloat16).encode(frames(4))
    assert (exact * rounded).sum(1).min() > 0.995


def test_autocast_around_it_changes_nothing() -> None:
    encoder = ClipImageEncoder.load(dtype=torch.float32)
    plain = encoder.features(frames(2))
    with torch.autocast("cpu", torch.bfloat16):
        assert torch.equal(encoder.features(frames(2)), plain)


def test_features_keep_their_place_in_the_picture() -> None:
    """What changes in the lower right corner changes the features of that corner most."""
    encoder = ClipImageEncoder.load(dtype=torch.float32)
    one = frames(1)
    other = one.clone()
    other[:, 96:, 96:] = 255 - other[:, 96:, 96:]
    change = (encoder.features(one) - encoder.features(other)).float().abs().view(-1, 4, 4).sum(0)
    assert int(change.argmax()) == 15
    assert change[0, 0] < 0.2 * change[3, 3]


@pytest.mark.parametrize(("height", "width"), [(256, 256), (384, 128), (200, 300), (64, 64), (32, 48)])
def test_frames_of_other_sizes_are_resampled(height: int, width: int) -> None:
    pictures = torch.full((2, height, width, 3), 77, dtype=torch.uint8)
    made = resampled(pictures)
    assert made.shape == (2, 3, FRAME_SIZE, FRAME_SIZE)
    torch.testing.assert_close(made.float(), torch.full_like(made.float(), 77), atol=0.5, rtol=0)
    assert ClipImageEncoder.load().encode(frames(2, height, width)).shape == (2, 512)


def test_a_large_frame_is_seen_as_its_smaller_self() -> None:
    encoder = ClipImageEncoder.load(dtype=torch.float32)
    large = frames(3, 256, 256)
    small = large.float().view(3, 128, 2, 128, 2, 3).mean((2, 4)).round().to(torch.uint8)
    assert (encoder.encode(large) * encoder.encode(small)).sum(1).min() > 0.99


def test_the_nearest_sentences_are_sorted_and_from_the_choice() -> None:
    encoder, frame = ClipImageEncoder.load(), frames(1)[0].numpy()
    near = nearest(encoder, shipped_text_encoder(), frame)
    assert len(near) == 5
    assert {item.sentence for item in near} <= set(stock_sentences())
    similarities = [item.similarity for item in near]
    assert similarities == sorted(similarities, reverse=True)
    own = (
        shipped_text_encoder().encode([near[0].sentence])[0] @ encoder.encode(torch.from_numpy(frame)[None])[0].numpy()
    )
    assert similarities[0] == pytest.approx(float(own), abs=1e-5)
    two = nearest(encoder, shipped_text_encoder(), frame, sentences=["a bed", "a sofa"])
    assert {item.sentence for item in two} == {"a bed", "a sofa"}


def test_encoders_of_different_spaces_are_not_compared() -> None:
    weights = load_weights(CLIP_WEIGHTS, "clip")
    stranger = ClipTextEncoder(weights.config, weights.tensors, "0123456789ab")
    with pytest.raises(ValueError, match="thinknav-clip@0123456789ab cannot be compared"):
        nearest(ClipImageEncoder.load(), stranger, np.zeros((128, 128, 3), np.uint8))


def test_the_small_encoder_sees_much_the_same() -> None:
    """What it makes of a picture is nearest to what the CLIP makes of the same one, and near."""
    clip, small = ClipImageEncoder.load(dtype=torch.float32), ClipImageEncoder.load_small(dtype=torch.float32)
    assert small.space == clip.space
    assert small.revision != clip.revision
    assert (small.frame_size, small.feature_size) == (64, clip.feature_size)
    pictures = [np.asarray(Image.open(VIEWS / f"clip-{number}.png")) for number in range(10)]
    views = torch.from_numpy(np.stack(pictures)[..., :3].copy())
    cosines = clip.encode(views) @ small.encode(views).T
    assert cosines.argmax(dim=1).tolist() == list(range(10))
    assert cosines.diagonal().min() > 0.7


def test_a_pupil_of_another_clip_is_refused(tmp_path: Path) -> None:
    weights = load_weights(SMALL_WEIGHTS, SMALL_KIND)
    path = tmp_path / "small.safetensors"
    save_weights(path, SMALL_KIND, weights.config | {"space": "other@1"}, weights.tensors)
    with pytest.raises(WeightsError, match=r"is the pupil of other@1, and .* holds thinknav-clip@.*train clip-small"):
        ClipImageEncoder.load_small(path)
