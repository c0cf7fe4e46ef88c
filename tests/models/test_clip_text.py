"""The text half of the small CLIP: unit vectors whatever the text, the same in any company, directions apart."""

import threading
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_models import TextEncoder
from thinknav_models.clip import ClipTextEncoder, shipped_text_encoder
from thinknav_models.clip import text as clip_text
from thinknav_models.clip.text import TextNetwork
from thinknav_models.clip.tokens import MAX_TOKENS, Vocabulary, split_words, word_parts
from thinknav_models.weights import WeightsError

SENTENCES = [
    "turn left toward the doorway",
    "stop, the chair is right ahead",
    "find a chair",
    "",
    "Stühle ÖFFNEN",
    "a bedroom with a bed on the left, a wardrobe straight ahead and far away, and a lamp on the right",
    "chair " * 100,
]


def similarity(first: str, second: str) -> float:
    a, b = shipped_text_encoder().encode([first, second])
    return float(a @ b)


def test_it_is_a_text_encoder() -> None:
    encoder: TextEncoder = shipped_text_encoder()
    assert encoder.dimension == 512
    assert encoder.space.name == "thinknav-clip"
    assert len(encoder.space.revision) == 12
    assert encoder.encode([]).shape == (0, 512)


@settings(deadline=None, max_examples=40)
@given(st.lists(st.text(max_size=60), max_size=4))
def test_embeddings_are_unit_vectors_whatever_the_text(texts: list[str]) -> None:
    embeddings = shipped_text_encoder().encode(texts)
    assert embeddings.shape == (len(texts), 512)
    assert embeddings.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(embeddings, axis=1), 1, atol=1e-5)


def test_a_text_is_embedded_alike_in_any_company() -> None:
    """To the last bit: which requests meet in a batch is chance, and must not decide what a policy sees."""
    together = ClipTextEncoder.load().encode(SENTENCES)
    for row, text in enumerate(SENTENCES):
        np.testing.assert_array_equal(ClipTextEncoder.load().encode([text])[0], together[row])
    reverse = ClipTextEncoder.load().encode(SENTENCES[::-1])
    np.testing.assert_array_equal(reverse[::-1], together)


@pytest.mark.parametrize("thing", ["chair", "sofa", "doorway", "zebra"])
def test_directions_lie_apart_and_wordings_close(thing: str) -> None:
    said = {
        "left": (f"turn left toward the {thing}", f"go left to the {thing}"),
        "right": (f"turn right toward the {thing}", f"go right to the {thing}"),
        "forward": (f"move forward to the {thing}", f"go straight to the {thing}"),
        "stop": (f"stop, the {thing} is right ahead", f"stop at the {thing}"),
    }
    within = [similarity(*pair) for pair in said.values()]
    between = [
        similarity(first, second)
        for one, firsts in said.items()
        for other, seconds in said.items()
        if one < other
        for first in firsts
        for second in seconds
    ]
    assert min(within) > max(between)


def test_strange_words_are_read_by_their_parts() -> None:
    assert similarity("turn left to the armchair", "turn left to the chair") < 0.9999
    assert similarity("go to the bookcases", "go to the bookcase") > similarity(
        "go to the bookcases", "go to the yacht"
    )


def test_what_it_remembers_is_bounded_and_right(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clip_text, "REMEMBERED_TEXTS", 3)
    asked: Counter[str] = Counter()
    embed = TextNetwork.embed

    def counting(self: TextNetwork, texts: list[str]) -> clip_text.Floats:
        asked.update(texts)
        return embed(self, texts)

    monkeypatch.setattr(TextNetwork, "embed", counting)
    encoder = ClipTextEncoder.load()
    first = encoder.encode(["a", "b", "a"])
    np.testing.assert_array_equal(first[0], first[2])
    np.testing.assert_array_equal(encoder.encode(["b", "a"]), first[1::-1])
    assert asked == {"a": 1, "b": 1}
    encoder.encode(["c", "d"])
    np.testing.assert_array_equal(encoder.encode(["a"]), first[:1])
    assert asked["a"] == 2


def test_threads_may_share_it() -> None:
    encoder = ClipTextEncoder.load()
    expected = shipped_text_encoder().encode(SENTENCES)
    seen: list[clip_text.Floats] = []

    def ask() -> None:
        seen.extend(encoder.encode(SENTENCES) for _ in range(20))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(seen) == 80
    assert all(np.array_equal(embeddings, expected) for embeddings in seen)


def test_missing_weights_are_named() -> None:
    with pytest.raises(WeightsError, match="there is no file of weights"):
        ClipTextEncoder.load(clip_text.CLIP_WEIGHTS.with_name("nothing.safetensors"))


def test_words_and_their_parts() -> None:
    assert split_words("Turn LEFT, to the TV-stand!") == [b"turn", b"left", b"to", b"the", b"tv", b"stand"]
    assert split_words("...") == [b""]
    assert len(split_words("chair " * 500)) == MAX_TOKENS
    assert len(word_parts(b"sofa", 100)) == 4 + 3 + 2  # <sofa> in runs of 3, 4 and 5
    assert word_parts(b"", 100)
    with pytest.raises(ValueError, match="each word once"):
        Vocabulary(["a", "a"])
