"""Requests of many kinds, right and wrong, and how each may be answered."""

import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from thinknav_proto import CONTENT_TYPE, Frame, SubgoalRequest, encode_requests
from thinknav_server.bench.load import http_request
from thinknav_server.bench.planner import POISON

_BUSY = 429
_OK = frozenset({200, _BUSY})
_REFUSED = frozenset({400})
_BODY_LIMIT = 64 * 1024 * 1024


@dataclass(frozen=True, eq=False)
class Kind:
    """requests: whole HTTP requests, of which any may be sent. statuses: that it may be answered with; none when nobody
    waits for an answer. weight: how often it is sent, beside others. hangs_up: whether its connection ends with it.
    """

    name: str
    requests: Sequence[bytes]
    statuses: frozenset[int]
    weight: float = 1.0
    hangs_up: bool = False


def kinds_of_requests(url: str, frames: Sequence[bytes]) -> list[Kind]:
    """All of them. frames: JPEGs."""
    return [
        *_good(url, frames),
        *_asked_for_failures(url, frames),
        *_bad_frames(url, frames),
        *_bad_bodies(url, frames),
    ]


def _good(url: str, frames: Sequence[bytes]) -> list[Kind]:
    texts = json.dumps({"texts": ["turn left toward the doorway", "move forward"]}).encode()
    eights = [_subgoals(url, *frames[start : start + 8]) for start in range(0, 64, 8)]
    return [
        Kind("a frame", [_subgoals(url, frame) for frame in frames[64:]], _OK, weight=10),
        Kind("eight frames", eights, _OK, weight=2),
        Kind("texts", [http_request(url, "/v1/embeddings", "application/json", texts)], _OK, weight=2),
        Kind("metrics", [_get(url, "/metrics")], frozenset({200}), weight=0.2),
        Kind("status page", [_get(url, "/")], frozenset({200}), weight=0.2),
        Kind("readiness", [_get(url, "/readyz")], frozenset({200})),
    ]


def _asked_for_failures(url: str, frames: Sequence[bytes]) -> list[Kind]:
    poison = [_subgoals(url, frame, goal=POISON) for frame in frames[:16]]
    hurried = [_subgoals(url, frame, deadline=0.002) for frame in frames[:16]]
    alone = [_subgoals(url, frame, goal="left alone") for frame in frames[:64]]
    return [
        # Seldom, because a batch with more than two of them fails as a whole, as it should.
        Kind("one that breaks the planner", poison, frozenset({502, _BUSY}), weight=0.1),
        Kind("one in a hurry", hurried, frozenset({200, _BUSY, 504})),
        Kind("one who hangs up", alone, frozenset(), hangs_up=True),
        Kind("one who hangs up halfway", [request[: len(request) // 2] for request in alone], frozenset(), 1.0, True),
    ]


def _bad_frames(url: str, frames: Sequence[bytes]) -> list[Kind]:
    cut = [_subgoals(url, frame[: len(frame) // 2]) for frame in frames[:8]]
    return [
        Kind("half a JPEG", cut, frozenset({200, 400, _BUSY})),  # libjpeg draws what there is, with a warning
        Kind("no JPEG", [_subgoals(url, b"\xff\xd8\xff" + bytes(range(256)))], _REFUSED | {_BUSY}),
        Kind("a bomb", [_subgoals(url, _png(60_000, 60_000), encoding="png")], _REFUSED),
        Kind("a long goal", [_subgoals(url, frames[0], goal="chair" * 1000)], _REFUSED),
    ]


def _bad_bodies(url: str, frames: Sequence[bytes]) -> list[Kind]:
    whole = encode_requests([SubgoalRequest(request_id="0", goal="bed", frame=Frame(encoding="jpeg", data=frames[0]))])
    large = http_request(url, "/v1/subgoals", CONTENT_TYPE, b"")
    large = large.replace(b"Content-Length: 0", f"Content-Length: {_BODY_LIMIT + 1}".encode())
    return [
        Kind("half a body", [http_request(url, "/v1/subgoals", CONTENT_TYPE, whole[:-100])], _REFUSED),
        Kind("no body", [http_request(url, "/v1/subgoals", CONTENT_TYPE, b"")], _REFUSED),
        Kind("a body of another type", [http_request(url, "/v1/subgoals", "text/plain", whole)], _REFUSED),
        Kind("a body that is too long", [large + bytes(100_000)], _REFUSED, 0.2, hangs_up=True),
        Kind(
            "texts that are none", [http_request(url, "/v1/embeddings", "application/json", b'{"texts": 5}')], _REFUSED
        ),
        Kind("nothing there", [_get(url, "/v2")], frozenset({404})),
        Kind("a wrong method", [_get(url, "/v1/subgoals")], frozenset({405})),
    ]


def _subgoals(url: str, *frames: bytes, goal: str = "chair", deadline: float = 20.0, encoding: str = "jpeg") -> bytes:
    requests = [
        SubgoalRequest(
            request_id=str(index),
            goal=goal,
            frame=Frame(encoding="png" if encoding == "png" else "jpeg", data=frame),
            deadline=deadline,
        )
        for index, frame in enumerate(frames)
    ]
    return http_request(url, "/v1/subgoals", CONTENT_TYPE, encode_requests(requests))


def _get(url: str, path: str) -> bytes:
    return http_request(url, path, "text/plain", b"").replace(b"POST", b"GET", 1)


def _png(width: int, height: int) -> bytes:
    """One whose header promises more than it holds."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    rows = chunk(b"IDAT", zlib.compress(bytes(10_000)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + rows + chunk(b"IEND", b"")
