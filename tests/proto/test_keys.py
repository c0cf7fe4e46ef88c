"""Zenoh keys."""

import pytest

from thinknav_proto import ALL_ALIVE, alive_key, embed_key, info_key, replica_of, subgoal_key


def test_keys_of_a_replica() -> None:
    assert subgoal_key("gpu-0") == "thinknav/v1/planner/gpu-0/subgoal"
    assert embed_key("gpu-0") == "thinknav/v1/planner/gpu-0/embed"
    assert info_key("gpu-0") == "thinknav/v1/planner/gpu-0/info"
    assert alive_key("*a".strip("*")) == ALL_ALIVE.replace("*", "a")


@pytest.mark.parametrize("key", [subgoal_key("a"), embed_key("a"), info_key("a"), alive_key("a")])
def test_the_replica_is_read_back(key: str) -> None:
    assert replica_of(key) == "a"


@pytest.mark.parametrize("replica", ["", "a/b", "*", "$x", "a" * 65, "a b"])
def test_a_replica_that_would_change_the_key_is_refused(replica: str) -> None:
    with pytest.raises(ValueError, match="replica"):
        subgoal_key(replica)


@pytest.mark.parametrize("key", ["", "thinknav/v1/planner/a", "thinknav/v2/planner/a/alive", "x/" + alive_key("a")])
def test_another_key_is_refused(key: str) -> None:
    with pytest.raises(ValueError, match="not a key of a planner"):
        replica_of(key)
