"""Who may ask: names and tokens, read and compared."""

import hmac
from pathlib import Path

import pytest

from thinknav_server.tokens import Tokens, load_tokens

ALICE = "a" * 32
BOB = "b" * 32


def test_a_token_names_its_client() -> None:
    tokens = Tokens({"alice": ALICE, "bob": BOB})
    assert [tokens.client(token) for token in (ALICE, BOB, "c" * 32, "", "a" * 31, "ü\udc80")] == [
        "alice",
        "bob",
        *[None] * 4,
    ]
    assert not Tokens({})
    assert Tokens({}).client("") is None


def test_every_token_is_compared_whole_whichever_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[tuple[int, int]] = []
    compare = hmac.compare_digest

    def recording(first: bytes, second: bytes) -> bool:
        compared.append((len(first), len(second)))
        return compare(first, second)

    tokens = Tokens({"alice": ALICE, "bob": BOB})
    monkeypatch.setattr(hmac, "compare_digest", recording)
    for asked in (ALICE, BOB, "short"):
        compared.clear()
        tokens.client(asked)
        assert compared == [(32, 32)] * 2


def test_tokens_come_from_a_file_and_from_the_environment(tmp_path: Path) -> None:
    path = tmp_path / "tokens"
    path.write_text(f"# the robots\n\nalice: {ALICE}\n")
    tokens = load_tokens(path, f"bob:{BOB},")
    assert tokens.users == {"alice": ALICE, "bob": BOB}
    assert not load_tokens(None, "")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("alice", "line 1: must read name:token"),
        ("", "has no line such as robots:x"),
        ("alice:short", "the token of 'alice' has 5 characters, fewer than 16; make one with: openssl rand -hex 32"),
        (f"alice:{ALICE} b", "holds other characters"),
        (f"al ice:{ALICE}", "a client is named by"),
        (f"alice:{ALICE}\nbob:{ALICE}", "two clients have the same token"),
        (f"alice:{ALICE}\nalice:{BOB}", "the client 'alice' has two tokens"),
    ],
)
def test_what_cannot_be_used_is_told_without_the_token(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "tokens"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as raised:
        load_tokens(path, "")
    assert ALICE not in str(raised.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=f"cannot read the tokens in {tmp_path}/none: No such file"):
        load_tokens(tmp_path / "none", "")
    path = tmp_path / "binary"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="it is not text"):
        load_tokens(path, "")
