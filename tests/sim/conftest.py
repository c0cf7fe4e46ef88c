"""Hand-made scenes: a box of a room, a wall in it, and chairs made of one box each."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.render import Renderer, make_renderer
from thinknav_sim.scene import Box, ObjectInstance, Scene

# Two triangles for each face of a box whose corners are numbered by the bits x + 2y + 4z.
BOX_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    np.int32,
)  # fmt: skip

# low x, y, z, high x, y, z
BoxCorners = tuple[float, float, float, float, float, float]
MakeRoom = Callable[..., Scene]


def corners(box: BoxCorners) -> NDArray[np.float32]:
    low, high = np.array(box[:3]), np.array(box[3:])
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return np.where(bits, high, low).astype(np.float32)


def build_room(
    size: tuple[float, float] = (6.0, 6.0),
    walls: Sequence[BoxCorners] = (),
    objects: Sequence[tuple[str, BoxCorners]] = (),
    name: str = "room",
) -> Scene:
    """A room from (0, 0) to `size` (x, z), 2.5 m high, with inner walls and boxes that are objects."""
    boxes: list[BoxCorners] = [(0.0, 0.0, 0.0, size[0], 2.5, size[1]), *walls, *(box for _, box in objects)]
    owners = [-1] * (1 + len(walls)) + list(range(len(objects)))
    return Scene(
        name=name,
        vertices=np.concatenate([corners(box) for box in boxes]),
        triangles=np.concatenate([BOX_TRIANGLES + 8 * i for i in range(len(boxes))]).astype(np.int32),
        colors=np.random.default_rng(0).integers(40, 255, (8 * len(boxes), 3)).astype(np.uint8),
        triangle_objects=np.repeat(np.array(owners, np.int32), 12),
        objects=tuple(
            ObjectInstance(i, category, Box(np.array(box[:3]), np.array(box[3:])))
            for i, (category, box) in enumerate(objects)
        ),
    )


@pytest.fixture(scope="session")
def make_room() -> MakeRoom:
    return build_room


@pytest.fixture(scope="session")
def empty_room() -> Scene:
    return build_room()


@pytest.fixture(scope="session")
def divided_room() -> Scene:
    """6 x 6 m with a wall at z = 3 that leaves a doorway from x = 5 on, a chair beyond it and a bed on this side."""
    return build_room(
        walls=[(0.0, 0.0, 2.95, 5.0, 2.5, 3.05)],
        objects=[("chair", (1.0, 0.0, 1.0, 1.5, 0.8, 1.5)), ("bed", (0.3, 0.0, 4.5, 2.0, 0.5, 5.8))],
        name="divided",
    )


@pytest.fixture(scope="session")
def renderer() -> Renderer:
    return make_renderer()
