"""The handshake with a planning service."""

from pathlib import Path

from thinknav_proto import DeadlineExceeded, Unauthenticated, Unavailable
from thinknav_trainer.planner.address import TOKEN_VARIABLE, Address, Credentials
from thinknav_trainer.planner.balancer import Balancer
from thinknav_trainer.planner.client import PlannerClient
from thinknav_trainer.planner.http_transport import HttpLink, HttpTransport
from thinknav_trainer.planner.link import background

HANDSHAKE_S = 6.0  # so that a command that finds no planner has said so within ten seconds


def connect(
    url: str,
    *,
    token: str = "",
    tls_ca: Path | None = None,
    timeout: float = 30.0,
    handshake: float = HANDSHAKE_S,
) -> PlannerClient:
    """A client of the service at a URL, or of its replicas, one of which has said who it is within `handshake` seconds.

    url: see `address`. token: `name:token`; over HTTP the token alone will do. tls_ca: PEM file of the authority that
    signed the service's certificate, where the system does not know it.
    timeout: seconds for later answers to questions without a deadline of their own.
    Raises Unavailable when nothing answers there, in one line that says how to start a service, Unauthenticated when
    the token is not known there, and ProtocolMismatch when what answers is no planning service of our protocol version.
    """
    transport = _open(Address.parse(url), _credentials(token), tls_ca, timeout, handshake)
    try:
        return background(lambda: PlannerClient(transport), "planner-handshake").result(handshake)
    except (TimeoutError, DeadlineExceeded):
        transport.close()
        raise Unavailable(
            f"the service at {url} did not say who it is within {handshake:g} s; is it a thinknav-server?"
        ) from None
    except Unauthenticated as error:
        transport.close()
        raise Unauthenticated(f"{url}: {error}; give it by planner.token_file or {TOKEN_VARIABLE}") from None
    except BaseException:
        transport.close()
        raise


def _open(
    address: Address, credentials: Credentials, tls_ca: Path | None, timeout: float, handshake: float
) -> Balancer:
    """Raises Unavailable."""
    if tls_ca is not None and not tls_ca.is_file():
        raise Unavailable(f"there is no file {tls_ca} (planner.tls_ca)")
    if address.scheme in ("zenoh", "zenohs"):
        # Only who asks for this transport loads its library.
        from thinknav_trainer.planner.zenoh_transport import zenoh_balancer

        return zenoh_balancer(address, credentials, tls_ca, timeout=timeout, patience=0.9 * handshake)
    links = [
        HttpLink(url, HttpTransport(url, token=credentials.token, tls_ca=tls_ca, timeout=timeout))
        for url in address.places
    ]
    return Balancer(links, timeout=timeout)


def _credentials(token: str) -> Credentials:
    try:
        return Credentials.parse(token)
    except ValueError as error:
        raise Unauthenticated(str(error)) from None
