"""Sentences: the true ones are borne out by what is seen, the false ones are not, and no word is unknown."""

import re
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thinknav_sim.task_config import Action
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.model_training.grammar import (
    DIRECTIONS,
    NAMES,
    ROOMS,
    SUBGOALS,
    THROUGH,
    article,
    describe,
    describe_briefly,
    describe_falsely,
    direction_to,
    plural,
    subgoal,
    subgoal_falsely,
    words,
)
from thinknav_trainer.model_training.scenery import Scenery, Sight, Way

SIDES = st.sampled_from(["left", "ahead", "right"])
SIGHTS = st.builds(
    Sight, st.sampled_from(sorted(NAMES)), SIDES, st.sampled_from(["near", "middle", "far"]), st.booleans()
)
WAYS = st.builds(Way, SIDES, st.sampled_from(sorted(ROOMS)))
SCENERIES = st.builds(
    Scenery,
    st.lists(SIGHTS, max_size=6, unique_by=lambda sight: (sight.category, sight.side)).map(tuple),
    st.lists(WAYS, max_size=2).map(tuple),
    st.none() | st.sampled_from(sorted(ROOMS)),
    st.none() | st.booleans(),
)

SEEN = Scenery((Sight("bed", "left", "near"),), (), "bedroom", None)
ACTIONS = {"left": Action.TURN_LEFT, "right": Action.TURN_RIGHT, "forward": Action.MOVE_FORWARD, "stop": Action.STOP}


@settings(deadline=None, max_examples=150)
@given(SCENERIES, st.integers(0, 2**32))
def test_every_word_is_in_the_vocabulary(seen: Scenery, seed: int) -> None:
    random, known = Random(seed), set(words())
    texts = [describe(seen, random), describe_briefly(seen, random), describe_falsely(seen, random)]
    texts += [subgoal(seen, random).text, subgoal_falsely(seen, random).text]
    for text in texts:
        assert text == text.strip()
        assert set(re.findall(r"[a-z0-9]+", text)) <= known, text
        assert re.findall(r"[a-z]", text)


@settings(deadline=None, max_examples=150)
@given(SCENERIES, st.integers(0, 2**32))
def test_a_true_subgoal_leads_where_something_is(seen: Scenery, seed: int) -> None:
    said = subgoal(seen, Random(seed))
    if seen.sights or seen.ways:
        assert said.direction in {*map(direction_to, seen.sights), *map(direction_to, seen.ways)}
    else:
        assert said.text in ("turn left", "turn right")


@settings(deadline=None, max_examples=150)
@given(SCENERIES.filter(lambda seen: len(seen.sights) == 1 and not seen.ways), st.integers(0, 2**32))
def test_a_false_subgoal_leads_elsewhere(seen: Scenery, seed: int) -> None:
    assert subgoal_falsely(seen, Random(seed)).direction != direction_to(seen.sights[0])


def test_what_is_said_falsely_is_false() -> None:
    random = Random(0)
    for _ in range(100):
        text = describe_falsely(SEEN, random)
        assert not ("bed " in f"{text} " and "left" in text), text


def test_a_long_sentence_says_what_and_where() -> None:
    random = Random(0)
    texts = {describe(SEEN, random) for _ in range(200)}
    assert len(texts) > 100
    assert all("bed" in text and "left" in text for text in texts)
    assert any("bedroom" in text for text in texts)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_subgoals_say_their_direction_as_the_judge_reads_it(direction: str) -> None:
    """The trainer judges agreement by a subgoal's first direction word; the grammar must not speak otherwise."""
    for wording in (*SUBGOALS[direction], *THROUGH[direction]):  # type: ignore[index]
        assert subgoal_direction(wording.format("sofa")) in (None, ACTIONS[direction]), wording


def test_nouns_have_articles_and_plurals() -> None:
    assert [article("sofa"), article("opening")] == ["a sofa", "an opening"]
    assert [plural(noun) for noun in ("shelf", "couch", "lamp", "chest of drawers")] == [
        "shelves",
        "couches",
        "lamps",
        "chests of drawers",
    ]
