"""What an operator may set of the planning service, and the defaults. The command line fills it in."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from thinknav_proto import Limits

DEFAULT_LIMITS = Limits(
    max_frames=256,
    max_pixels=2048 * 2048,
    max_body_bytes=64 * 1024 * 1024,
    max_text_length=1000,
    max_texts=1024,
)


class Settings(BaseModel):
    """How requests are batched and what is accepted.

    One section of the settings; the doors' is `DoorSettings`.

    max_batch: requests that the planner sees at once.
    max_wait: seconds that a request may wait for others to fill its batch, unless as many have come as there were
        lately: a client that is alone does not wait. Batches also form from what arrives while the planner is busy.
    queue_size: requests that wait at most; more are refused at once. A request that is admitted waits for at most
        queue_size / max_batch + 1 batches.
    cache_size: answers that are remembered, for requests of temperature 0; 0 remembers none.
    show_frames: whether the status page shows the last frames, which may be private.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    max_batch: Annotated[int, Field(ge=1)] = 32
    max_wait: Annotated[float, Field(ge=0, le=10)] = 0.0
    queue_size: Annotated[int, Field(ge=1)] = 256
    cache_size: Annotated[int, Field(ge=0)] = 10_000
    show_frames: bool = False
    limits: Limits = DEFAULT_LIMITS


class DoorSettings(BaseModel):
    """Where the service listens, and to whom.

    host, port: of the HTTP door; port 0 picks a free one.
    token_file, tokens: the clients that may ask, `name:token` a line, or separated by commas; none: everybody.
    tls_cert, tls_key: PEM files; with them the doors speak TLS.
    insecure: whether everybody may ask where others than this machine can.
    zenoh: HOST:PORT of the zenoh door; none, no such door. zenoh_connect: HOST:PORT of routers and other replicas that
        it joins, separated by commas. replica: its name among them; empty: one of its own.
    tls_ca: PEM file of whoever has signed the certificates of those that it joins.
    max_held_bytes: of all bodies that the service holds at one moment. body_timeout: seconds for a body to arrive.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8765
    token_file: Path | None = None
    tokens: Annotated[str, Field(repr=False)] = ""
    tls_cert: Path | None = None
    tls_key: Path | None = None
    insecure: bool = False
    zenoh: str | None = None
    zenoh_connect: str = ""
    replica: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{0,64}$")] = ""
    tls_ca: Path | None = None
    max_held_bytes: Annotated[int, Field(ge=1)] = 1024 * 1024 * 1024
    body_timeout: Annotated[float, Field(gt=0)] = 30.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.tls_key and not self.tls_cert:
            raise ValueError("--tls-key needs --tls-cert: the certificate that the key belongs to")
        if self.zenoh is None:
            for option, given in (("--zenoh-connect", self.zenoh_connect), ("--replica", self.replica)):
                if given:
                    raise ValueError(f"{option} needs --zenoh: the address to answer on")
        return self
