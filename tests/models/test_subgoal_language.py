"""Tokens of subgoals: what is one, and the way there and back."""

import pytest

from thinknav_models.subgoal_language import DIRECTIONS, Vocabulary, words_of

SENTENCES = ("turn left toward the doorway", "stop, the tv monitor is right ahead", "move forward to the sofa")


@pytest.fixture
def vocabulary() -> Vocabulary:
    return Vocabulary(words_of(SENTENCES))


@pytest.mark.parametrize("sentence", SENTENCES)
def test_sentences_come_back(vocabulary: Vocabulary, sentence: str) -> None:
    assert vocabulary.decode(vocabulary.encode(sentence)) == sentence


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_direction_is_one_token(vocabulary: Vocabulary, direction: str) -> None:
    assert vocabulary.encode(direction) == [vocabulary.directions[DIRECTIONS.index(direction)]]


def test_a_goal_is_read_with_underscores_and_capitals(vocabulary: Vocabulary) -> None:
    assert vocabulary.encode("TV_monitor") == vocabulary.encode("tv monitor")


def test_a_strange_word_is_unknown(vocabulary: Vocabulary) -> None:
    assert vocabulary.encode("zebra") == [vocabulary.unknown]


def test_special_tokens_are_not_said(vocabulary: Vocabulary) -> None:
    assert vocabulary.decode([*vocabulary.encode("turn left"), vocabulary.end, vocabulary.padding]) == "turn left"


def test_numbers_depend_on_the_words_alone() -> None:
    words = words_of(SENTENCES)
    assert Vocabulary(words).tokens == Vocabulary([*words, *words]).tokens
