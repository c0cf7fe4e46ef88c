"""What a client and a planning service say to each other, as immutable, validated values.

Every message is strict: a wrong type, an unknown field in a request or a number that is not finite raises
pydantic's ValidationError. The bytes on the wire are `codec`'s concern; sizes that a particular service
accepts are told by its `PlannerInfo.limits` and checked by that service, not here.
"""

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from thinknav_proto.arrays import EMBEDDING_DIMENSION, Embedding, Embeddings

PROTOCOL_VERSION = 1

Text = Annotated[str, Field(min_length=1)]
Seconds = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=1)]
# name@revision, for planners and for embedding spaces.
Identity = Annotated[str, Field(pattern=r"^[A-Za-z0-9_./-]+@[A-Za-z0-9_.-]+$", max_length=200)]


class Message(BaseModel):
    """Base of all messages: immutable and strict; equal when all their values are equal."""

    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True
    )

    def __eq__(self, other: object) -> bool:
        # Embeddings are arrays, which have no truth value of equality; their dumped bytes do.
        return type(self) is type(other) and self.model_dump() == other.model_dump()


class Told(Message):
    """Base of what a service tells: fields that a later service adds are ignored."""

    model_config = ConfigDict(extra="ignore")


class Frame(Message):
    """One RGB image.

    encoding: "raw" (height x width x 3 uint8, row by row from the top), "jpeg" or "png".
    data: the bytes in that encoding.
    width, height: pixels; given for raw frames, and for those alone.
    heading: radians, counter-clockwise seen from above, relative to the request's own frame (0 for that one).
    """

    encoding: Literal["raw", "jpeg", "png"]
    data: Annotated[bytes, Field(min_length=1)]
    width: Count | None = None
    height: Count | None = None
    heading: float = 0.0

    @classmethod
    def raw(cls, rgb: NDArray[np.uint8], heading: float = 0.0) -> Self:
        """A raw frame of an image (H, W, 3) uint8. Raises ValueError for another shape or type."""
        if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8:
            raise ValueError(f"a frame must be (H, W, 3) uint8, not {rgb.shape} {rgb.dtype}")
        height, width, _ = rgb.shape
        return cls(encoding="raw", data=rgb.tobytes(), width=width, height=height, heading=heading)

    @model_validator(mode="after")
    def _size_fits(self) -> Self:
        if self.encoding != "raw":
            if self.width is not None or self.height is not None:
                raise ValueError(f"a {self.encoding} frame states its own size; leave out width and height")
            return self
        if self.width is None or self.height is None:
            raise ValueError("a raw frame needs width and height")
        if len(self.data) != self.width * self.height * 3:
            raise ValueError(
                f"a raw frame of {self.width} x {self.height} has {self.width * self.height * 3} bytes, "
                f"not {len(self.data)}"
            )
        return self


class SubgoalRequest(Message):
    """Asks where to go next, seen from one frame.

    request_id: the client's own name for the request, given back in the reply.
    goal: the object category to find ("chair").
    mode: "subgoal" for one short instruction, "plan" for a list of them, for the whole episode.
    recent: earlier views, oldest first, each with its heading relative to `frame`.
    temperature: of sampling; 0 asks for the planner's most likely answer.
    deadline: seconds, counted from the request's arrival, after which the answer is of no use.
    """

    protocol_version: Annotated[int, Field(ge=PROTOCOL_VERSION, le=PROTOCOL_VERSION)] = PROTOCOL_VERSION
    request_id: Annotated[str, Field(min_length=1, max_length=128)]
    goal: Text
    frame: Frame
    mode: Literal["subgoal", "plan"] = "subgoal"
    recent: tuple[Frame, ...] = ()
    temperature: Annotated[float, Field(ge=0, le=10)] = 0.0
    deadline: Annotated[float, Field(gt=0, le=3600)] = 30.0

    @property
    def frames(self) -> tuple[Frame, ...]:
        """All frames of the request, the recent ones first."""
        return (*self.recent, self.frame)


class Timings(Told):
    """Where the time of a reply went, in seconds: in the queue, in the planner, in the text encoder."""

    queued: Seconds
    planned: Seconds
    embedded: Seconds


class SubgoalReply(Told):
    """The answer to one request.

    subgoal: a short instruction ("turn left toward the doorway"); in mode "plan" the first of `instructions`.
    instructions: in mode "plan", at least one; else empty.
    embedding: (512,) float32, of the subgoal. embedding_space: where it lies, or None from a service that does not say.
    confidence: 0 to 1, or None from a planner that has none.
    planner: who answered, as name@revision.
    """

    request_id: str
    subgoal: Text
    instructions: tuple[Text, ...] = ()
    embedding: Embedding
    embedding_space: Identity | None = None
    confidence: Annotated[float, Field(ge=0, le=1)] | None = None
    planner: Identity
    timings: Timings


class Limits(Told):
    """What a service accepts.

    max_frames: frames in one body, recent ones counted. max_pixels: width times height of one frame.
    max_body_bytes: of one body. max_text_length: characters of a goal or of a text to embed.
    max_texts: texts in one body.
    """

    max_frames: Count
    max_pixels: Count
    max_body_bytes: Count
    max_text_length: Count
    max_texts: Count


class PlannerInfo(Told):
    """Who answers, asked for at start-up.

    planner, revision: its name, and a hash or tag of its weights or script.
    prompt_hash: of the prompt it puts to its model; "none" for a planner without one.
    embedding_space: name@revision of the text encoder; embeddings of two spaces must not be mixed.
    """

    protocol_version: int
    planner: Annotated[str, Field(pattern=r"^[A-Za-z0-9_./-]+$", max_length=100)]
    revision: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$", max_length=64)]
    prompt_hash: Annotated[str, Field(min_length=1, max_length=64)]
    embedding_space: Identity
    embedding_dimension: Count = EMBEDDING_DIMENSION
    limits: Limits

    @property
    def identity(self) -> str:
        """The planner as replies name it: name@revision."""
        return f"{self.planner}@{self.revision}"


class EmbedRequest(Message):
    """Asks for the embeddings of texts."""

    texts: Annotated[tuple[Text, ...], Field(min_length=1)]


class EmbedReply(Told):
    """The embeddings (N, 512) float32 of N texts, in their order, and the space they lie in."""

    embedding_space: Identity
    embeddings: Embeddings
