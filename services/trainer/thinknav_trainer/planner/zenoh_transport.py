"""Replicas found over zenoh: by their liveliness tokens they come into a balancer, and go.

Knows sessions, keys and replies; what the answers mean is for the balancer.
"""

import json
import logging
import secrets
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

import zenoh

from thinknav_proto import (
    ALL_ALIVE,
    DeadlineExceeded,
    Unavailable,
    embed_key,
    info_key,
    replica_of,
    subgoal_key,
)
from thinknav_trainer.planner.address import Address, Credentials
from thinknav_trainer.planner.balancer import Balancer
from thinknav_trainer.planner.link import Question, background, settle, settle_error

logger = logging.getLogger(__name__)

_KEYS: dict[Question, Callable[[str], str]] = {"subgoal": subgoal_key, "embed": embed_key, "info": info_key}

# Milliseconds of silence after which a replica takes this client for gone, as the client does with a replica.
LEASE_MS = 3000


def zenoh_balancer(
    address: Address, credentials: Credentials, tls_ca: Path | None, *, timeout: float, patience: float
) -> Balancer:
    """A balancer over the replicas that can be found from these places. Raises Unavailable."""
    where = f"{address.scheme}://{','.join(address.places)}"
    if credentials.token and not credentials.name:
        raise Unavailable("over zenoh a token needs its client's name; give it as name:token")
    try:
        session = zenoh.open(_config(address, credentials, tls_ca))
    except zenoh.ZError as error:
        raise Unavailable(f"no zenoh session to {where}: {' '.join(str(error).split())[:200]}") from None
    nobody = (
        f"no replica of a planning service is alive at {where}; start one with: thinknav-server serve --zenoh "
        f"{address.places[0]}{_hint(address, credentials, tls_ca)}"
    )

    def close() -> None:
        try:
            session.close()  # type: ignore[no-untyped-call]
        except zenoh.ZError as error:  # whom it would say goodbye to is out of reach; the session is gone all the same
            logger.warning("the zenoh session to %s did not close in good order: %s", where, error)

    balancer = Balancer(nobody=nobody, patience=patience, fixed=False, timeout=timeout, on_close=close)
    client = secrets.token_hex(8)

    def changed(sample: zenoh.Sample) -> None:
        replica = replica_of(str(sample.key_expr))
        if sample.kind == zenoh.SampleKind.PUT:
            balancer.add(ZenohLink(session, replica, client))
        else:
            balancer.remove(replica)

    session.liveliness().declare_subscriber(ALL_ALIVE, zenoh.handlers.Callback(changed), history=True)
    return balancer


class ZenohLink:
    """A replica under its own keys. client: who asks, so that the service can be fair among clients."""

    def __init__(self, session: zenoh.Session, replica: str, client: str) -> None:
        self.name = replica
        self._session = session
        self._client = client

    def send(self, question: Question, body: bytes, patience: float) -> "Future[bytes]":
        answer: Future[bytes] = Future()

        def replied(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                settle(answer, reply.ok.payload.to_bytes())
            elif reply.err is not None:
                told = reply.err.payload.to_bytes()
                if told == b"Timeout":  # zenoh's own words
                    settle_error(
                        answer, DeadlineExceeded(f"the replica {self.name} did not answer within {patience:g} s")
                    )
                else:
                    settle(answer, told)

        def ended() -> None:  # zenoh tells of a replica that has gone by ending a query without any reply
            settle_error(answer, Unavailable(f"the replica {self.name} went without an answer"))

        def ask() -> None:
            try:
                self._session.get(
                    _KEYS[question](self.name),
                    zenoh.handlers.Callback(replied, ended),
                    payload=body,
                    attachment=self._client,
                    timeout=patience,
                )
            except zenoh.ZError as error:
                settle_error(answer, Unavailable(f"the replica {self.name} cannot be asked: {error}"))

        # A replica that has stopped reading holds up whoever sends to it.
        background(ask, "planner-zenoh")
        return answer

    def close(self) -> None:
        """The session is the balancer's."""


def _config(address: Address, credentials: Credentials, tls_ca: Path | None) -> zenoh.Config:
    scheme = "tls" if address.scheme == "zenohs" else "tcp"
    values: dict[str, object] = {
        "mode": "peer",
        "listen/endpoints": [],
        "connect/endpoints": [f"{scheme}/{place}" for place in address.places],
        "connect/timeout_ms": -1,  # goes on trying in the background
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 250, "period_max_ms": 2000, "period_increase_factor": 2},
        "scouting/multicast/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
    }
    if tls_ca:
        values["transport/link/tls/root_ca_certificate"] = str(tls_ca)
    if credentials.token:
        values["transport/auth/usrpwd/user"] = credentials.name
        values["transport/auth/usrpwd/password"] = credentials.token
    config = zenoh.Config()
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _hint(address: Address, credentials: Credentials, tls_ca: Path | None) -> str:
    """Zenoh does not say why nobody answers."""
    causes = [] if credentials.token else ["it asks for a token (planner.token_file)"]
    causes += ["it does not know this client's name and token"] if credentials.token else []
    causes += ["it speaks no TLS", "its certificate is not signed by planner.tls_ca"] if tls_ca else []
    if address.scheme == "zenoh":
        causes.append("it speaks TLS (zenohs://)")
    return f"; if one runs there: {', or '.join(causes)}"
