"""The command line's options of the doors: where the service listens, to whom, and how much it takes."""

import os
from pathlib import Path
from typing import Annotated

import typer

from thinknav_proto import Limits
from thinknav_proto.codec import MAX_ARRAY_LENGTH
from thinknav_server.settings import DEFAULT_LIMITS, DoorSettings

_DOORS = DoorSettings()


def door_settings(
    host: Annotated[
        str, typer.Option(help="Address to listen on; others than loopback reach the network.")
    ] = _DOORS.host,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen on; 0 picks a free one.")] = _DOORS.port,
    token_file: Annotated[
        Path | None, typer.Option(help="File of the clients that may ask, name:token a line. [env: also TOKENS]")
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
    """The doors. Raises ValidationError for what does not go together."""
    return DoorSettings(
        host=host,
        port=port,
        token_file=token_file,
        tokens=os.environ.get("THINKNAV_SERVER_TOKENS", ""),
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


def accepted_limits(
    max_body_bytes: Annotated[int, typer.Option(min=1, help="Of one body.")] = DEFAULT_LIMITS.max_body_bytes,
    max_frames: Annotated[
        int, typer.Option(min=1, max=MAX_ARRAY_LENGTH, help="Frames in one body.")
    ] = DEFAULT_LIMITS.max_frames,
    max_pixels: Annotated[int, typer.Option(min=1, help="Of one frame.")] = DEFAULT_LIMITS.max_pixels,
    max_text_length: Annotated[
        int, typer.Option(min=1, help="Characters of a goal or a text.")
    ] = DEFAULT_LIMITS.max_text_length,
) -> Limits:
    """What is accepted."""
    return Limits(
        max_frames=max_frames,
        max_pixels=max_pixels,
        max_body_bytes=max_body_bytes,
        max_text_length=max_text_length,
        max_texts=DEFAULT_LIMITS.max_texts,
    )
