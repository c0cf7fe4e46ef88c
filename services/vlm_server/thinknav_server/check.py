"""Tries a planner before it is served: loads it, asks about one frame, and tells where the time went."""

import asyncio
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thinknav_proto import Frame, SubgoalReply, SubgoalRequest
from thinknav_server.hosts import Host
from thinknav_server.images import frame_of_file
from thinknav_server.service import PlanningService
from thinknav_server.settings import Settings

_SIZE = 256


@dataclass(frozen=True)
class Stage:
    """What was done, the seconds it took, and what came of it."""

    name: str
    seconds: float
    result: str = ""


def check_planner(load: Callable[[], Host], goal: str, image: Path | None) -> Iterator[Stage]:
    """The stages, each as soon as it is over.

    Raises ValueError or OSError when the planner cannot be loaded or the image not be read, PlannerError when it
    gives no answer.
    """
    frame = _painted_frame() if image is None else frame_of_file(image.read_bytes())
    began = time.perf_counter()
    host = load()
    service = PlanningService(host, Settings(cache_size=0))
    yield Stage("load", time.perf_counter() - began, f"{service.info.identity}, {service.info.embedding_space}")
    for name, reply, seconds in asyncio.run(_ask_twice(service, goal, frame)):
        timings = reply.timings
        yield Stage(f"{name} answer", seconds, reply.subgoal)
        yield Stage("  decode and plan", timings.planned)
        yield Stage("  embed", timings.embedded)
        yield Stage("  queue and process", max(0.0, seconds - timings.planned - timings.embedded))


async def _ask_twice(service: PlanningService, goal: str, frame: Frame) -> list[tuple[str, SubgoalReply, float]]:
    """The first answer may have to warm something up; the second shows what a lone request costs."""
    answers = []
    async with service:
        for name in ("first", "second"):
            began = time.perf_counter()
            request = SubgoalRequest(request_id=name, goal=goal, frame=frame, deadline=3600.0)
            reply = await service.answer(request)
            answers.append((name, reply, time.perf_counter() - began))
    return answers


def _painted_frame() -> Frame:
    """Sky, floor and a doorway, so to speak: something for a planner to look at where there is no photograph."""
    rgb = np.full((_SIZE, _SIZE, 3), (200, 205, 210), np.uint8)
    rgb[_SIZE // 2 :] = (120, 90, 60)
    rgb[60:200, 150:210] = (40, 40, 45)
    return Frame.raw(rgb)
