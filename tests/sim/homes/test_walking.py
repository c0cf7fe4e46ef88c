"""Can an agent walk everywhere that matters? Judged by the triangles alone, on a finer grid than the generator's."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from thinknav_sim.scene import GOAL_CATEGORIES, ObjectInstance, Scene

RADIUS_M = 0.18
EYES_M = 0.88
CELL_M = 0.05
REACH_M = 0.65


@dataclass(frozen=True)
class Floor:
    """walkable: cells of the largest region that an agent can walk in; x, z: their centres."""

    walkable: NDArray[np.bool_]
    x: NDArray[np.float64]
    z: NDArray[np.float64]

    def distances(self, instance: ObjectInstance) -> NDArray[np.float64]:
        """From each cell to the object's box, on the floor."""
        low, high = instance.box.low, instance.box.high
        dx = np.maximum(np.maximum(low[0] - self.x, self.x - high[0]), 0)
        dz = np.maximum(np.maximum(low[2] - self.z, self.z - high[2]), 0)
        away: NDArray[np.float64] = np.hypot(dx[:, None], dz[None, :])
        return away


def surface_points(scene: Scene) -> NDArray[np.float64]:
    """Points on all triangles, less than a cell apart, that are in the way of the agent's body."""
    corners = scene.vertices.astype(np.float64)[scene.triangles]
    corners = corners[(corners[..., 1].min(axis=1) < EYES_M) & (corners[..., 1].max(axis=1) > CELL_M)]
    longest = np.sqrt(((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2)).max(axis=1)
    steps = np.ceil(longest / (0.8 * CELL_M)).astype(int)
    points = []
    for step in np.unique(steps):
        i, j = np.meshgrid(np.arange(step + 1), np.arange(step + 1))
        weights = np.stack((i, j, step - i - j), axis=-1)[i + j <= step] / step
        points.append((weights[None] @ corners[steps == step]).reshape(-1, 3))
    everything = np.concatenate(points)
    return everything[(everything[:, 1] > CELL_M) & (everything[:, 1] < EYES_M)]


def walk(scene: Scene) -> Floor:
    low, high = scene.bounds.low[[0, 2]], scene.bounds.high[[0, 2]]
    shape = np.ceil((high - low) / CELL_M).astype(int) + 1
    taken = np.zeros(shape, dtype=bool)
    cells = np.floor((surface_points(scene)[:, [0, 2]] - low) / CELL_M).astype(int)
    taken[cells[:, 0], cells[:, 1]] = True
    x, z = (low[axis] + (np.arange(shape[axis]) + 0.5) * CELL_M for axis in (0, 1))
    free = ndimage.distance_transform_edt(~taken) * CELL_M > RADIUS_M + CELL_M / 2
    labels, count = ndimage.label(free)
    inside = np.zeros(shape, dtype=bool)
    for room in scene.rooms:
        x0, z0, x1, z1 = room.bounds
        inside |= ((x > x0) & (x < x1))[:, None] & ((z > z0) & (z < z1))[None, :]
    sizes = np.bincount(labels[inside], minlength=count + 1)
    sizes[0] = 0
    return Floor(labels == sizes.argmax(), x, z)


def sees(scene: Scene, eye: NDArray[np.float64], instance: ObjectInstance) -> bool:
    """Whether a ray from the eye meets the object first, aimed at the middles of its triangles."""
    corners = scene.vertices.astype(np.float64)[scene.triangles]
    mine = np.flatnonzero(scene.triangle_objects == instance.object_id)
    a, along, up = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    for target in mine[:: max(1, len(mine) // 10)]:
        direction = corners[target].mean(axis=0) - eye
        p = np.cross(direction, up)
        determinant = (along * p).sum(axis=1)
        safe = np.where(np.abs(determinant) < 1e-12, np.inf, determinant)
        u = ((eye - a) * p).sum(axis=1) / safe
        q = np.cross(eye - a, along)
        v, distance = (direction * q).sum(axis=1) / safe, (up * q).sum(axis=1) / safe
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 1e-6)
        if hit.any() and scene.triangle_objects[np.where(hit, distance, np.inf).argmin()] == instance.object_id:
            return True
    return False


@pytest.fixture(scope="module")
def floors(homes: list[Scene]) -> list[tuple[Scene, Floor]]:
    return [(home, walk(home)) for home in homes]


def goals(scene: Scene) -> list[ObjectInstance]:
    return [instance for instance in scene.objects if instance.category in GOAL_CATEGORIES]


def test_every_room_can_be_walked_into(floors: list[tuple[Scene, Floor]]) -> None:
    for home, floor in floors:
        for room in home.rooms:
            x0, z0, x1, z1 = room.bounds
            in_room = ((floor.x > x0) & (floor.x < x1))[:, None] & ((floor.z > z0) & (floor.z < z1))[None, :]
            assert (floor.walkable & in_room).sum() * CELL_M**2 > 0.4, (home.name, room)


def test_every_goal_can_be_walked_to(floors: list[tuple[Scene, Floor]]) -> None:
    for home, floor in floors:
        for instance in goals(home):
            assert floor.distances(instance)[floor.walkable].min() <= REACH_M, (home.name, instance)


def test_every_goal_can_be_seen_from_beside_it(floors: list[tuple[Scene, Floor]]) -> None:
    for home, floor in floors[::4]:
        for instance in goals(home):
            places = np.argwhere(floor.walkable & (floor.distances(instance) <= REACH_M))
            some = places[np.linspace(0, len(places) - 1, 8).astype(int)]
            eyes = (np.array((floor.x[i], EYES_M, floor.z[j])) for i, j in some)
            assert any(sees(home, eye, instance) for eye in eyes), (home.name, instance)


def test_the_floor_is_mostly_open(floors: list[tuple[Scene, Floor]]) -> None:
    for home, floor in floors:
        area = sum((x1 - x0) * (z1 - z0) for x0, z0, x1, z1 in (room.bounds for room in home.rooms))
        assert floor.walkable.sum() * CELL_M**2 > 0.2 * area, home.name
