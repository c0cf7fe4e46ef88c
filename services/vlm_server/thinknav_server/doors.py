"""Opens the doors of a service as an operator has set them: who may ask, how much, by which sockets.

Everything that can be wrong with the settings is found here, before anything is served.
"""

import socket
import ssl
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass

from starlette.applications import Starlette

from thinknav_server.http import create_app
from thinknav_server.intake import Intake
from thinknav_server.server import bind, check_exposure, tls_context
from thinknav_server.service import PlanningService
from thinknav_server.settings import DoorSettings
from thinknav_server.tokens import Tokens, load_tokens


@dataclass(frozen=True)
class Doors:
    """The application, the socket that it is to be served on, and TLS for it, if wanted."""

    app: Starlette
    listener: socket.socket
    tls: ssl.SSLContext | None


def open_doors(service: PlanningService, settings: DoorSettings) -> Doors:
    """Raises ValueError or OSError with one line that says what to do."""
    if settings.max_held_bytes < service.info.limits.max_body_bytes:
        raise ValueError("--max-held-bytes is of all bodies, and may not be less than --max-body-bytes, of one")
    tokens = load_tokens(settings.token_file, settings.tokens)
    tls = tls_context(settings.tls_cert, settings.tls_key) if settings.tls_cert else None
    intake = Intake(service.info.limits.max_body_bytes, settings.max_held_bytes, settings.body_timeout)
    listener = bind(settings.host, settings.port)
    try:
        check_exposure(listener.getsockname()[0], tokens, tls is not None, settings.insecure)
        others = [_zenoh_door(service, settings, tokens, intake)] if settings.zenoh else []
    except (ValueError, OSError):
        listener.close()
        raise
    return Doors(create_app(service, tokens, intake, *others), listener, tls)


def _zenoh_door(
    service: PlanningService, settings: DoorSettings, tokens: Tokens, intake: Intake
) -> AbstractAsyncContextManager[object]:
    # Only who asks for this door loads its library.
    from thinknav_server.zenoh_door import ZenohDoor
    from thinknav_server.zenoh_session import default_replica, open_session

    session = open_session(settings, tokens, intake.max_body_bytes)
    return ZenohDoor(session, service, intake, settings.replica or default_replica())
