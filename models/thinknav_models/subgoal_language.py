"""The words of the subgoal VLM: what its tokens are, and how sentences become tokens and back.

A direction ("turn left") is one token and the first of every sentence, so that its probability is the model's
confidence in it. Knows nothing of networks.
"""

import re
from collections.abc import Sequence

PADDING, END, NEXT, UNKNOWN = "<pad>", "<end>", "<next>", "<unknown>"
SPECIAL = (PADDING, END, NEXT, UNKNOWN)  # NEXT joins the sentences of a plan
DIRECTIONS = ("stop", "move forward", "turn left", "turn right")

_TOKEN = re.compile("|".join([*DIRECTIONS, r"[a-z0-9]+", ","]))


class Vocabulary:
    """Tokens by number: the special ones, the directions, then the words it was made with."""

    def __init__(self, words: Sequence[str]) -> None:
        self.words = tuple(dict.fromkeys(words))
        self.tokens = (*SPECIAL, *DIRECTIONS, *(word for word in self.words if word not in DIRECTIONS))
        self._number = {token: number for number, token in enumerate(self.tokens)}
        self.padding, self.end, self.next, self.unknown = (self._number[token] for token in SPECIAL)
        self.directions = tuple(self._number[direction] for direction in DIRECTIONS)

    def __len__(self) -> int:
        return len(self.tokens)

    def encode(self, text: str) -> list[int]:
        """Numbers of the tokens of a text, whatever its case; underscores part words, unknown words are `unknown`."""
        found = _TOKEN.findall(text.lower().replace("_", " "))
        return [self._number.get(token, self.unknown) for token in found]

    def decode(self, numbers: Sequence[int]) -> str:
        """The text of tokens; special ones are left out."""
        text = " ".join(self.tokens[number] for number in numbers if number >= len(SPECIAL))
        return text.replace(" ,", ",")


def words_of(texts: Sequence[str]) -> tuple[str, ...]:
    """The distinct tokens of some texts, sorted: what a vocabulary for them must hold."""
    return tuple(sorted({token for text in texts for token in _TOKEN.findall(text.lower().replace("_", " "))}))
