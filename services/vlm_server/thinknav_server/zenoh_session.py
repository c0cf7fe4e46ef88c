"""Opens the zenoh session that a service answers on: addresses, TLS, users. Knows nothing of queries."""

import ipaddress
import json
import os
import socket
import tempfile
from pathlib import Path

import zenoh

from thinknav_server.server import check_exposure
from thinknav_server.settings import DoorSettings
from thinknav_server.tokens import Tokens

# Milliseconds of silence after which clients take a frozen or unplugged replica for gone. Zenoh's own threads send the
# signs of life, so that a planner at work does not hold them up.
LEASE_MS = 3000


def open_session(settings: DoorSettings, tokens: Tokens, max_body_bytes: int) -> zenoh.Session:
    """Raises ValueError or OSError with one line that says what to do."""
    assert settings.zenoh is not None
    host, port = _address(settings.zenoh, "--zenoh")
    check_exposure(_resolve(host), tokens, settings.tls_cert is not None, settings.insecure)
    scheme = "tls" if settings.tls_cert else "tcp"
    others = [_address(other, "--zenoh-connect") for other in settings.zenoh_connect.split(",") if other.strip()]
    strangers = [other for other, _ in others if not _is_here(other)]
    if strangers and not tokens and not settings.insecure:
        raise ValueError(
            f"whoever reaches {strangers[0]} may ask the planner through it; name the clients that may with "
            "--token-file, or say --insecure"
        )
    values: dict[str, object] = {
        "mode": "peer",
        "listen/endpoints": [f"{scheme}/{host}:{port}"],
        "connect/endpoints": [f"{scheme}/{other}:{number}" for other, number in others],
        "connect/timeout_ms": -1,  # goes on trying in the background
        "connect/exit_on_failure": False,
        "scouting/multicast/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        # A body over the limit is refused by name; far over it, its link is closed.
        "transport/link/rx/max_message_size": 4 * max_body_bytes + 65536,
    }
    if settings.tls_cert:
        values["transport/link/tls/listen_certificate"] = str(settings.tls_cert)
        values["transport/link/tls/listen_private_key"] = str(settings.tls_key or settings.tls_cert)
    if settings.tls_ca:
        values["transport/link/tls/root_ca_certificate"] = str(settings.tls_ca)
    with tempfile.TemporaryDirectory() as folder:
        if tokens:
            # To the other replicas that it connects to, this one is the first of the clients that it knows.
            user, password = next(iter(tokens.users.items()))
            users = Path(folder) / "users"  # read while the session opens, and gone after that
            users.write_text("".join(f"{name}:{token}\n" for name, token in tokens.users.items()), encoding="utf-8")
            values["transport/auth/usrpwd/dictionary_file"] = str(users)
            values["transport/auth/usrpwd/user"] = user
            values["transport/auth/usrpwd/password"] = password
        config = zenoh.Config()
        for key, value in values.items():
            config.insert_json5(key, json.dumps(value))
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            reason = " ".join(str(error).split())[:200]
            raise OSError(f"cannot listen on zenoh {host}:{port}: {reason}; try another address by --zenoh") from None


def default_replica() -> str:
    """A name that no other replica has."""
    host = "".join(letter if letter.isalnum() or letter in "_.-" else "-" for letter in socket.gethostname())[:40]
    return f"{host if host.isascii() else 'replica'}-{os.urandom(4).hex()}"


def _address(text: str, option: str) -> tuple[str, int]:
    host, colon, port = text.strip().rpartition(":")
    if not (colon and host and port.isdigit() and 0 < int(port) < 65536):
        raise ValueError(f"{option} takes HOST:PORT such as 127.0.0.1:7447, not {text.strip()!r}")
    return host, int(port)


def _is_here(host: str) -> bool:
    """Whether an address is this machine's loopback; a name that need not be known yet is not asked for."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def _resolve(host: str) -> str:
    try:
        return str(socket.getaddrinfo(host.strip("[]"), None, type=socket.SOCK_STREAM)[0][4][0])
    except (OSError, UnicodeError) as error:
        reason = (error.strerror if isinstance(error, OSError) else "not a host name") or str(error)
        raise OSError(f"cannot listen on zenoh host {host}: {reason}; try another by --zenoh") from None
