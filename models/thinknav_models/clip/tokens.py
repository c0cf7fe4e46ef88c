"""Texts as numbers: words of a vocabulary, and the parts of words that are in none.

The same text gives the same numbers on every machine and Python version. Knows no network.
"""

import re
import zlib
from collections.abc import Sequence

MAX_TOKENS = 48  # more of a text is not read

# Letters and digits of ASCII, and every byte of other characters, whose case is left alone: Python's Unicode tables
# change from version to version, bytes do not.
_WORD = re.compile(rb"[a-z0-9\x80-\xff]+")
_LONGEST_WORD = 32  # bytes; what follows is no language
_PART_LENGTHS = (3, 4, 5)


def split_words(text: str) -> list[bytes]:
    """The words of a text, in lower case, at most MAX_TOKENS of them; one empty word where there is none."""
    words = [word[:_LONGEST_WORD] for word in _WORD.findall(text.encode("utf-8", "replace").lower())[:MAX_TOKENS]]
    return words or [b""]


def word_parts(word: bytes, buckets: int) -> list[int]:
    """The bucket of each run of 3 to 5 bytes of a word and its two ends (Bojanowski et al. 2017); never empty."""
    padded = b"<" + word + b">"
    parts = [padded[i : i + n] for n in _PART_LENGTHS for i in range(len(padded) - n + 1)] or [padded]
    return [zlib.crc32(part) % buckets for part in parts]


class Vocabulary:
    """Words with numbers from 0, in the order in which they are given."""

    def __init__(self, words: Sequence[str]) -> None:
        self.words = tuple(words)
        self._numbers = {word.encode(): number for number, word in enumerate(words)}
        if len(self._numbers) != len(words):
            raise ValueError("a vocabulary holds each word once")

    def __len__(self) -> int:
        return len(self.words)

    def number(self, word: bytes) -> int | None:
        """The number of a word, none for a stranger."""
        return self._numbers.get(word)
