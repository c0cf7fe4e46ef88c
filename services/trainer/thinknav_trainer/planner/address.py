"""Where a planning service is, as users write it, and what opens it.

http://host:8765    https://host    http://one:8765,http://two:8765
zenoh://host:7447   zenohs://one:7447,two:7447   (the s is for TLS)
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

from thinknav_proto import Unavailable

TOKEN_VARIABLE = "THINKNAV_PLANNER_TOKEN"

_FORMS = "those read http://127.0.0.1:8765, or zenoh://127.0.0.1:7447"


@dataclass(frozen=True)
class Address:
    """scheme: http, https, zenoh or zenohs, of all places. places: whole URLs for HTTP, host:port for zenoh."""

    scheme: str
    places: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> Self:
        """Raises Unavailable, which names what is wrong."""
        parts = [part.strip().rstrip("/") for part in text.split(",")]
        scheme = parts[0].partition("://")[0]
        if scheme not in ("http", "https", "zenoh", "zenohs"):
            raise Unavailable(f"{text!r} is not the URL of a planning service; {_FORMS}")
        if scheme in ("zenoh", "zenohs"):
            places = tuple(part.removeprefix(f"{scheme}://") for part in parts)
            for place in places:
                _check_host_and_port(place)
        else:
            schemes = {part.partition("://")[0] for part in parts}
            if not schemes <= {"http", "https"}:
                raise Unavailable(f"{text!r} mixes HTTP with something else; {_FORMS}, several separated by commas")
            places = tuple(parts)
        if len(set(places)) < len(places):
            raise Unavailable(f"{text!r} names a place twice")
        return cls(scheme, places)


@dataclass(frozen=True)
class Credentials:
    """What opens a service: a token, and for zenoh the name of the client that it belongs to."""

    token: str = ""
    name: str = ""

    @classmethod
    def parse(cls, text: str) -> Self:
        """`name:token`, or the token alone. Raises ValueError for characters that no token has."""
        name, _, token = text.strip().rpartition(":")
        if not token.isascii() or any(not character.isprintable() or character == " " for character in token):
            raise ValueError("a token holds letters, digits and - . _ ~ + / =, nothing else")
        return cls(token.strip(), name.strip())


def read_token(file: Path | None) -> str:
    """`name:token` from a file with that one line, else from THINKNAV_PLANNER_TOKEN; empty without both.

    Raises ValueError that says what to do.
    """
    if file is None:
        return os.environ.get(TOKEN_VARIABLE, "")
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise ValueError(f"cannot read the token in {file} (planner.token_file): {reason}") from None
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if len(lines) != 1:
        raise ValueError(f"{file} (planner.token_file) must hold one line name:token, not {len(lines)}")
    return lines[0]


def _check_host_and_port(place: str) -> None:
    try:
        parts = urlsplit(f"//{place}")
        right = bool(parts.hostname and parts.port) and parts.netloc == place and "@" not in place
    except ValueError:
        right = False
    if not right:
        raise Unavailable(f"{place!r} is not host:port, as in zenoh://127.0.0.1:7447")
