"""The clients that an operator knows: names, each with a secret token.

They are written `name:token`, one a line in a file or separated by commas in the environment. Over HTTP the token
travels as `Authorization: Bearer <token>`; over zenoh name and token are user and password.
"""

import hashlib
import hmac
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

MIN_TOKEN_LENGTH = 16

_NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")
_TOKEN = re.compile(r"[A-Za-z0-9_.~+/=-]+")  # what RFC 6750 lets a bearer token hold


class Tokens:
    """Who may ask. Raises ValueError, which names no token, for a name or a token that cannot be used."""

    def __init__(self, tokens: Mapping[str, str]) -> None:
        for name, token in tokens.items():
            _check(name, token)
        self._digests = {name: _digest(token) for name, token in tokens.items()}
        if len(set(self._digests.values())) < len(tokens):
            raise ValueError("two clients have the same token; give each its own")
        self.users = dict(tokens)

    def __bool__(self) -> bool:
        return bool(self.users)

    def client(self, token: str) -> str | None:
        """The name of the client that a token belongs to, or None.

        Takes the same time whichever token it is and however much of it is right.
        """
        digest = _digest(token)
        found = None
        for name, known in self._digests.items():
            if hmac.compare_digest(known, digest):
                found = name
        return found


def load_tokens(file: Path | None, inline: str) -> Tokens:
    """The tokens of a file, and those given inline, `name:token` separated by commas. Raises ValueError."""
    entries: list[tuple[str, str]] = []
    if file is not None:
        try:
            lines = file.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise ValueError(f"cannot read the tokens in {file}: {reason}") from None
        entries += _entries(lines, f"the token file {file}, line")
    entries += _entries(inline.split(","), "the tokens given in the environment, number")
    names = [name for name, _ in entries]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ValueError(f"the client {min(twice)!r} has two tokens; give each client one")
    if file is not None and not entries:
        raise ValueError(f"the token file {file} has no line such as robots:{'x' * MIN_TOKEN_LENGTH}")
    return Tokens(dict(entries))


def _entries(lines: Iterable[str], where: str) -> Iterable[tuple[str, str]]:
    """Names and tokens; empty lines and those that begin with # are left out."""
    for number, line in enumerate(lines, 1):
        entry = line.strip()
        if not entry or entry.startswith("#"):
            continue
        name, colon, token = entry.partition(":")
        if not colon:
            raise ValueError(f"{where} {number}: must read name:token")
        yield name.strip(), token.strip()


def _check(name: str, token: str) -> None:
    if not _NAME.fullmatch(name):
        raise ValueError(f"a client is named by 1 to 64 of the characters A-Z a-z 0-9 _ . -, not {name[:64]!r}")
    if len(token) < MIN_TOKEN_LENGTH:
        raise ValueError(
            f"the token of {name!r} has {len(token)} characters, fewer than {MIN_TOKEN_LENGTH}; "
            "make one with: openssl rand -hex 32"
        )
    if not _TOKEN.fullmatch(token):
        raise ValueError(f"the token of {name!r} holds other characters than A-Z a-z 0-9 _ . ~ + / = -")


def _digest(token: str) -> bytes:
    """Of equal length for all tokens, so that comparing does not tell how long one is."""
    return hashlib.sha256(token.encode("utf-8", "surrogateescape")).digest()
