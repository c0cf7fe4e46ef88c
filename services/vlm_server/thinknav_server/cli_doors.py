"""The options of a service's doors, and its limits; see `cli_sections`."""

import os
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from thinknav_proto import Limits, describe
from thinknav_server.settings import DEFAULT_LIMITS, DoorSettings

TOKENS_VARIABLE = "THINKNAV_SERVER_TOKENS"

_DOORS = DoorSettings()


def door_settings(
    host: Annotated[str, typer.Option(help="Address to listen on; others than loopback reach the network.")] = (
        _DOORS.host
    ),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 picks a free one.")] = _DOORS.port,
    token_file: Annotated[
        Path | None,
        typer.Option(help=f"File of the clients that may ask, name:token a line; {TOKENS_VARIABLE} may name more."),
    ] = None,
    tls_cert: Annotated[Path | None, typer.Option(help="PEM file of the certificate to serve with.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="PEM file of its key, unless that holds it too.")] = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Let everybody ask, even from beyond this machine.")
    ] = False,
    zenoh: Annotated[str | None, typer.Option(help="HOST:PORT to answer on over zenoh, too.")] = None,
    zenoh_connect: Annotated[
        str, typer.Option(help="HOST:PORT of zenoh routers and replicas to join, separated by commas.")
    ] = "",
    replica: Annotated[str, typer.Option(help="Name among the replicas; by default one of its own.")] = "",
    tls_ca: Annotated[
        Path | None, typer.Option(help="PEM file of who signed the certificates of those it joins.")
    ] = None,
    max_held_bytes: Annotated[int, typer.Option(min=1, help="Of all bodies at one moment.")] = _DOORS.max_held_bytes,
    body_timeout: Annotated[float, typer.Option(min=0.001, help="Seconds for a body to arrive.")] = _DOORS.body_timeout,
) -> DoorSettings:
    """Where to listen, and to whom."""
    try:
        return DoorSettings(
            host=host,
            port=port,
            token_file=token_file,
            tokens=os.environ.get(TOKENS_VARIABLE, ""),
            tls_cert=tls_cert,
            tls_key=tls_key,
            insecure=insecure,
            zenoh=zenoh,
            zenoh_connect=zenoh_connect,
            replica=replica,
            tls_ca=tls_ca,
            max_held_bytes=max_held_bytes,
            body_timeout=body_timeout,
        )
    except ValidationError as error:
        raise typer.BadParameter(describe(error)) from None


def limits(
    max_body_bytes: Annotated[int, typer.Option(min=1, help="Of one body.")] = DEFAULT_LIMITS.max_body_bytes,
    max_frames: Annotated[int, typer.Option(min=1, help="Frames in one body.")] = DEFAULT_LIMITS.max_frames,
    max_pixels: Annotated[int, typer.Option(min=1, help="Of one frame.")] = DEFAULT_LIMITS.max_pixels,
    max_text_length: Annotated[
        int, typer.Option(min=1, help="Characters of a goal or a text.")
    ] = DEFAULT_LIMITS.max_text_length,
) -> Limits:
    """What is accepted."""
    changed: dict[str, Any] = {
        "max_body_bytes": max_body_bytes,
        "max_frames": max_frames,
        "max_pixels": max_pixels,
        "max_text_length": max_text_length,
    }
    return DEFAULT_LIMITS.model_copy(update=changed)
