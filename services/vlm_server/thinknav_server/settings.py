"""What an operator may set of the planning service, and the defaults. The command line fills it in."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

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

    max_batch: requests that the planner sees at once.
    max_wait: seconds that a request may wait for others to fill its batch. 0 adds nothing to a lone request;
        batches still form from what arrives while the planner is busy.
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
