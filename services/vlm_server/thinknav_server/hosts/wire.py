"""What the service and its planner process say to each other, over a pair of local sockets.

A message is a header (length, number of the call, kind) and a body; an answer bears its call's number. Requests
travel as clients encode them, images undecoded. Both ends are ours and of one version, so nothing is negotiated.
"""

import enum
import struct
from collections.abc import Sequence

import msgpack
import numpy as np
from numpy.typing import NDArray

from thinknav_models import EmbeddingSpace
from thinknav_proto import PlannerError, error_from_wire
from thinknav_server.hosts.base import Identity
from thinknav_server.planners.base import Plan, PlannerIdentity
from thinknav_server.thinking import Thought

HEADER = struct.Struct(">IQB")


class Kind(enum.IntEnum):
    """What a message is."""

    LOAD = 0  # to the process: its options; the answer is LOADED or REFUSED
    LOADED = 1
    REFUSED = 2
    THINK = 3  # to the process and back
    EMBED = 4
    FAILED = 5  # the answer to a call that raised


def message(call: int, kind: Kind, body: bytes = b"") -> bytes:
    """A whole message."""
    return HEADER.pack(len(body), call, kind) + body


def pack_identity(identity: Identity) -> bytes:
    """The body of LOADED."""
    planner, space = identity.planner, identity.space
    packed: bytes = msgpack.packb(
        (planner.name, planner.revision, planner.prompt_hash, space.name, space.revision, identity.dimension)
    )
    return packed


def unpack_identity(body: bytes) -> Identity:
    """Who was loaded."""
    name, revision, prompt_hash, space_name, space_revision, dimension = msgpack.unpackb(body)
    return Identity(PlannerIdentity(name, revision, prompt_hash), EmbeddingSpace(space_name, space_revision), dimension)


def pack_thoughts(thoughts: Sequence[Thought | PlannerError]) -> bytes:
    """The answer to THINK."""
    packed: bytes = msgpack.packb(
        [
            thought.to_wire()
            if isinstance(thought, PlannerError)
            else (
                thought.plan.instructions,
                thought.plan.confidence,
                thought.embedding.astype(np.float32, copy=False).tobytes(),
                thought.planned,
                thought.embedded,
            )
            for thought in thoughts
        ]
    )
    return packed


def unpack_thoughts(body: bytes) -> list[Thought | PlannerError]:
    """The answers to a batch, in its order."""
    return [
        error_from_wire(thought)
        if isinstance(thought, dict)
        else Thought(Plan(thought[0], thought[1]), np.frombuffer(thought[2], np.float32), thought[3], thought[4])
        for thought in msgpack.unpackb(body, use_list=False)
    ]


def pack_texts(texts: Sequence[str]) -> bytes:
    """The body of EMBED."""
    packed: bytes = msgpack.packb(list(texts))
    return packed


def unpack_texts(body: bytes) -> list[str]:
    """Texts to embed."""
    texts: list[str] = msgpack.unpackb(body)
    return texts


def unpack_embeddings(body: bytes, dimension: int) -> NDArray[np.float32]:
    """(N, dimension) float32."""
    return np.frombuffer(body, np.float32).reshape(-1, dimension)
