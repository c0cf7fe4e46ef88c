"""The encoder without weights: the same bits everywhere, unit vectors, directions apart."""

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_models import HashedWords, TextEncoder

SENTENCES = [
    "turn left toward the doorway",
    "stop, the chair is right ahead",
    "find a chair",
    "",
    "Stühle ÖFFNEN",
]


def similarity(first: str, second: str) -> float:
    a, b = HashedWords().encode([first, second])
    return float(a @ b)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.text(max_size=60), max_size=4))
def test_embeddings_are_unit_vectors_whatever_the_text(texts: list[str]) -> None:
    embeddings = HashedWords().encode(texts)
    assert embeddings.shape == (len(texts), 512)
    assert embeddings.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(embeddings, axis=1), 1, atol=1e-6)
    if texts:
        np.testing.assert_array_equal(HashedWords().encode(texts[:1])[0], embeddings[0])


def test_the_bits_never_change() -> None:
    """Recorded thoughts and trained policies rest on them: a change of bits needs another revision."""
    encoder: TextEncoder = HashedWords()
    bits = encoder.encode(SENTENCES).astype("<f4").tobytes()
    assert str(encoder.space) == "hashed-words@9de4018efaa8"
    assert hashlib.sha256(bits).hexdigest()[:16] == "19e169ba09e81c09"


@pytest.mark.parametrize("rest", ["toward the doorway", "to the sofa", "into the hallway and go on"])
def test_left_and_right_are_far_apart(rest: str) -> None:
    assert similarity(f"turn left {rest}", f"turn right {rest}") < 0.55
    assert similarity(f"turn left {rest}", f"turn left {rest}, slowly") > 0.8
    assert similarity(f"turn left {rest}", f"move forward {rest}") < 0.55


def test_words_in_common_bring_texts_closer() -> None:
    assert similarity("turn left toward the door", "turn left toward the sofa") > 0.6
    assert abs(similarity("turn left toward the door", "a green plant on some shelf")) < 0.2


def test_case_and_punctuation_do_not_matter_but_order_does() -> None:
    assert similarity("Turn LEFT, now!", "turn left now") == pytest.approx(1)
    assert similarity("left then right", "right then left") < 0.99
