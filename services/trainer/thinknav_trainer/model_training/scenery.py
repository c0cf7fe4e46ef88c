"""What a frame shows, in the terms that people describe it by: things, where they are, the room, the ways out of it.

Told from depth images and what the scene says of objects and rooms; scans have no rooms, and need none. Knows no words.
"""

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render import Camera
from thinknav_sim.scene import Scene
from thinknav_trainer.visible import FramePoints, SeenObject, frame_points, objects_at

Side = Literal["left", "ahead", "right"]
Reach = Literal["near", "middle", "far"]

AHEAD_RAD = math.radians(12)  # to either side
NEAR_M = 1.2
FAR_M = 3.5
LEAST_SHARE = 0.006  # of the picture, for a thing to be worth a word
LEAST_WAY_SHARE = 0.015  # of the picture, for a way into another room to be one
BLOCKED_M = 0.8
CLEAR_M = 2.5
BODY_M = (0.1, 0.88)  # heights over the floor that are in an agent's way

MIRRORED: dict[Side, Side] = {"left": "right", "ahead": "ahead", "right": "left"}


@dataclass(frozen=True)
class Sight:
    """Things of one category on one side. `many`: more than one."""

    category: str
    side: Side
    reach: Reach
    many: bool = False


@dataclass(frozen=True)
class Way:
    """A way out of the room that can be seen, and the function of the room it leads to."""

    side: Side
    room: str


@dataclass(frozen=True)
class Scenery:
    """What one frame shows, the most striking first.

    room: the function of the room it was taken in, none where it is not known.
    blocked: whether something stands right ahead; none where that is neither so nor the opposite.
    """

    sights: tuple[Sight, ...]
    ways: tuple[Way, ...]
    room: str | None
    blocked: bool | None

    def mirrored(self) -> "Scenery":
        """What the frame shows when it is flipped, left for right."""
        return replace(
            self,
            sights=tuple(replace(sight, side=MIRRORED[sight.side]) for sight in self.sights),
            ways=tuple(replace(way, side=MIRRORED[way.side]) for way in self.ways),
        )


def scenery(scene: Scene, poses: NDArray[np.float64], depth: NDArray[np.float32], camera: Camera) -> list[Scenery]:
    """What each of N frames shows. poses: (N, 4). depth: (N, H, W), metres along the optical axis, of this camera."""
    points = frame_points(poses, depth, camera)
    seen = objects_at(scene, points, LEAST_SHARE)
    return [
        Scenery(_sights(objects), _ways(scene, pose, frame), room_at(scene, pose), _blocked(frame, pose[1]))
        for pose, objects, frame in zip(poses, seen, points, strict=True)
    ]


def side_of(bearing: float) -> Side:
    """The side that a bearing (radians, left positive) is on."""
    return "ahead" if abs(bearing) <= AHEAD_RAD else "left" if bearing > 0 else "right"


def reach_of(distance: float) -> Reach:
    """Whether a distance in metres is near or far."""
    return "near" if distance < NEAR_M else "far" if distance > FAR_M else "middle"


def room_at(scene: Scene, pose: NDArray[np.float64]) -> str | None:
    """The function of the room that a pose is in; none in doorways and in scenes without rooms."""
    x, z = float(pose[0]), float(pose[2])
    for room in scene.rooms:
        x0, z0, x1, z1 = room.bounds
        if x0 <= x <= x1 and z0 <= z <= z1:
            return room.function
    return None


def _sights(seen: tuple[SeenObject, ...]) -> tuple[Sight, ...]:
    """Objects of one category on one side become one sight, as near as the nearest of them."""
    groups: defaultdict[tuple[str, Side], list[SeenObject]] = defaultdict(list)
    for item in seen:
        groups[item.category, side_of(item.bearing)].append(item)
    return tuple(
        Sight(category, side, reach_of(min(item.distance for item in items)), len(items) > 1)
        for (category, side), items in groups.items()
    )


def _ways(scene: Scene, pose: NDArray[np.float64], frame: FramePoints) -> tuple[Way, ...]:
    """Whoever sees the inside of another room sees a way into it."""
    ways = []
    for room in scene.rooms:
        x0, z0, x1, z1 = room.bounds
        if x0 <= pose[0] <= x1 and z0 <= pose[2] <= z1:
            continue
        x, z = frame.points[0], frame.points[2]
        inside = (x > x0) & (x < x1) & (z > z0) & (z < z1)
        share = np.count_nonzero(inside) / frame.rays
        if share >= LEAST_WAY_SHARE:
            bearing = float(np.arctan2(frame.left[inside], frame.forward[inside]).mean())
            ways.append((share, Way(side_of(bearing), room.function)))
    return tuple(way for _, way in sorted(ways, key=lambda item: -item[0]))


def _blocked(frame: FramePoints, floor: float) -> bool | None:
    height = frame.points[1] - floor
    in_the_way = (np.abs(frame.left) < 0.2) & (height > BODY_M[0]) & (height < BODY_M[1]) & (frame.forward < CLEAR_M)
    if not in_the_way.any():
        return False
    return True if float(frame.forward[in_the_way].min()) < BLOCKED_M else None
