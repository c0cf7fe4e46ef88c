"""Where a service is and what opens it, as users write it."""

from pathlib import Path

import pytest

from thinknav_trainer.config import ConfigError, TrainConfig, load_config, parse_config
from thinknav_trainer.planner import Unavailable, read_token
from thinknav_trainer.planner.address import Address, Credentials


@pytest.mark.parametrize(
    ("text", "scheme", "places"),
    [
        ("http://a:1", "http", ("http://a:1",)),
        ("http://a:1/, https://b/x", "http", ("http://a:1", "https://b/x")),
        ("zenoh://a:1", "zenoh", ("a:1",)),
        ("zenohs://a:1,b:2, zenohs://[::1]:3", "zenohs", ("a:1", "b:2", "[::1]:3")),
    ],
)
def test_places_are_read(text: str, scheme: str, places: tuple[str, ...]) -> None:
    assert Address.parse(text) == Address(scheme, places)


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            "a:1",
            "ftp://a",
            "zenoh://",
            "zenoh://a",
            "zenoh://a:x",
            "zenoh://a:1,",
            "zenoh://me@a:1",
            "zenoh://a:1/b",
        ),
        *("http://a,zenoh://b:1", "zenoh://a:1,http://b", "http://a,http://a/", "zenoh://a:1,zenohs://b:2"),
    ],
)
def test_what_is_no_place_is_named(text: str) -> None:
    with pytest.raises(Unavailable):
        Address.parse(text)


def test_credentials_have_a_name_or_none() -> None:
    assert Credentials.parse("robots:secret=") == Credentials("secret=", "robots")
    assert Credentials.parse(" secret\n") == Credentials("secret", "")
    assert Credentials.parse("") == Credentials()
    for wrong in ("two words", "tab\tbed", "ü"):
        with pytest.raises(ValueError, match="nothing else"):
            Credentials.parse(wrong)


def test_a_token_comes_from_a_file_or_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("THINKNAV_PLANNER_TOKEN", raising=False)
    assert read_token(None) == ""
    monkeypatch.setenv("THINKNAV_PLANNER_TOKEN", "env-token")
    assert read_token(None) == "env-token"
    path = tmp_path / "token"
    path.write_text("# mine\nrobots:file-token\n\n")
    assert read_token(path) == "robots:file-token"
    path.write_text("a:b\nc:d\n")
    with pytest.raises(ValueError, match="must hold one line name:token, not 2"):
        read_token(path)
    with pytest.raises(ValueError, match=r"cannot read the token in .*none \(planner.token_file\): No such file"):
        read_token(tmp_path / "none")


def test_the_configuration_has_a_section_that_a_bare_url_may_stand_for() -> None:
    config = load_config("cpu", None, ["planner=zenoh://a:1", "planner.token_file=/run/token"])
    assert (config.planner.url, config.planner.token_file) == ("zenoh://a:1", Path("/run/token"))
    file_first = load_config("cpu", None, ["planner.token_file=/run/token", "planner=zenoh://a:1"])
    assert file_first.planner == config.planner
    again = parse_config(config.with_planner("http://b").model_dump(mode="json"))
    assert (again.planner.url, again.planner.token_file) == ("http://b", Path("/run/token"))
    assert config.with_planner(None) is config
    assert parse_config({"planner": "http://c"}).planner.url == "http://c"
    with pytest.raises(ConfigError, match=r"planner\.tokenfile.*did you mean 'planner\.token_file'"):
        load_config("cpu", None, ["planner.tokenfile=x"])
    assert TrainConfig().planner.url == "http://127.0.0.1:8765"
