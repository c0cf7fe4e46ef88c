"""Frames of many homes without end, batch after batch, each batch the same whenever it is made.

A batch mixes some homes; from batch to batch they give way to new ones. Knows no network and no sentences.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.homes import Split, generate_home, home_seed
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import Camera, make_renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.model_training.scenery import Scenery, scenery

NEAR_OBJECTS = 0.4  # share of poses that stand near an object and look toward it
NEAR_OBJECT_M = (0.4, 2.5)  # from its box, along the floor
NEAR_OBJECT_TURN = math.radians(35)  # how far it may be from the middle of the picture


class SceneSource(Protocol):
    """Where scenes come from; it crosses to worker processes by pickle."""

    def scene(self, index: int) -> Scene:
        """The scene of this number, from 0 without end."""


@dataclass(frozen=True)
class HomeSource:
    """The procedural homes of a split, a new one each time."""

    split: Split
    first: int = 0

    def scene(self, index: int) -> Scene:
        return generate_home(home_seed(self.split, self.first + index))


@dataclass(frozen=True)
class ScanSource:
    """Imported scans, over and over."""

    paths: tuple[Path, ...]

    def scene(self, index: int) -> Scene:
        from thinknav_sim.scans import load_scan

        return load_scan(self.paths[index % len(self.paths)]).scene

    def categories(self) -> tuple[str, ...]:
        """Of the objects in them."""
        scenes = [self.scene(index) for index in range(len(self.paths))]
        return tuple(sorted({instance.category for scene in scenes for instance in scene.objects}))


@dataclass(frozen=True)
class Frames:
    """N frames: rgb (N, H, W, 3) uint8, what each shows, and the number of its scene (N,)."""

    rgb: NDArray[np.uint8]
    sceneries: list[Scenery]
    scenes: NDArray[np.int64]


@dataclass(frozen=True)
class FramePlan:
    """How batches of frames are made; it crosses to worker processes.

    A batch has scenes_per_batch x frames_per_scene frames, and a scene stays for scenes_per_batch x batches_per_scene
    batches. mirror: flip a scene's frames in a batch left for right, every other time.
    """

    source: SceneSource
    task: ObjectNavConfig
    seed: int
    scenes_per_batch: int = 8
    frames_per_scene: int = 16
    batches_per_scene: int = 2
    mirror: bool = True


class FrameMaker:
    """Makes the batches of a plan, in any order; each follows from its number alone."""

    def __init__(self, plan: FramePlan) -> None:
        task = plan.task
        self.plan = plan
        self.camera = Camera(task.width, task.height, task.hfov, task.camera_height)
        self._renderer = make_renderer()
        self._open: dict[int, tuple[Scene, NavigationGrid, int]] = {}

    def batch(self, index: int) -> Frames:
        """Frames number `index`. Raises SceneError for a scene nobody can stand in."""
        wanted = self._scenes(index)
        parts = [self._frames(number, np.random.default_rng((self.plan.seed, index, number))) for number in wanted]
        return Frames(
            np.concatenate([rgb for rgb, _ in parts]),
            [seen for _, sceneries in parts for seen in sceneries],
            np.repeat(np.array(wanted), self.plan.frames_per_scene),
        )

    def sizes(self, index: int, sizes: Sequence[int]) -> list[NDArray[np.uint8]]:
        """The pictures of batch number `index` in several sizes, not mirrored: (N, size, size, 3) uint8 of each."""
        task = self.plan.task
        cameras = [Camera(size, size, task.hfov, task.camera_height) for size in sizes]
        parts: list[list[NDArray[np.uint8]]] = [[] for _ in sizes]
        for number in self._scenes(index):
            _, scene_id, poses = self._poses(number, np.random.default_rng((self.plan.seed, index, number)))
            for part, camera in zip(parts, cameras, strict=True):
                part.append(self._renderer.render(np.full(len(poses), scene_id), poses, camera)[0])
        return [np.concatenate(part) for part in parts]

    def _scenes(self, index: int) -> range:
        """The numbers of the scenes of a batch; others are closed."""
        first = index // self.plan.batches_per_scene
        wanted = range(first, first + self.plan.scenes_per_batch)
        for number in [number for number in self._open if number not in wanted]:
            self._renderer.remove_scene(self._open.pop(number)[2])
        return wanted

    def _poses(self, number: int, rng: np.random.Generator) -> tuple[Scene, int, NDArray[np.float64]]:
        """A scene, its number in the renderer, and poses in it."""
        if number not in self._open:
            scene = self.plan.source.scene(number)
            grid = make_grid(scene, self._renderer, self.plan.task)
            self._open[number] = (scene, grid, self._renderer.add_scene(scene))
        scene, grid, scene_id = self._open[number]
        return scene, scene_id, random_poses(scene, grid, rng, self.plan.frames_per_scene)

    def _frames(self, number: int, rng: np.random.Generator) -> tuple[NDArray[np.uint8], list[Scenery]]:
        scene, scene_id, poses = self._poses(number, rng)
        rgb, depth = self._renderer.render(np.full(len(poses), scene_id), poses, self.camera)
        seen = scenery(scene, poses, depth[..., 0], self.camera)
        if self.plan.mirror and rng.random() < 0.5:
            return rgb[:, :, ::-1], [what.mirrored() for what in seen]
        return rgb, seen


def random_poses(
    scene: Scene, grid: NavigationGrid, rng: np.random.Generator, count: int, near_objects: float = NEAR_OBJECTS
) -> NDArray[np.float64]:
    """(count, 4) poses: anywhere with any heading, and a share near objects and turned to them, more or less."""
    poses = np.empty((count, 4))
    poses[:, :3] = grid.random_navigable(rng, count)
    poses[:, 3] = rng.uniform(-math.pi, math.pi, count)
    if not scene.objects:
        return poses
    for row in np.flatnonzero(rng.random(count) < near_objects).tolist():
        box = scene.objects[int(rng.integers(len(scene.objects)))].box
        candidates = _around(box.low, box.high, rng)
        standing = candidates[grid.is_navigable(candidates)]
        if len(standing):
            position = grid.positions(*grid.cells(standing[:1]))[0]
            away = box.center - position
            poses[row, :3] = position
            poses[row, 3] = math.atan2(-away[0], -away[2]) + rng.uniform(-NEAR_OBJECT_TURN, NEAR_OBJECT_TURN)
    return poses


def _around(low: NDArray[np.float64], high: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """(16, 3) positions on the floor around a box, at random distances from it."""
    angle = rng.uniform(-math.pi, math.pi, 16)
    distance = rng.uniform(*NEAR_OBJECT_M, 16)
    center, half = (low + high) / 2, (high - low) / 2
    x = center[0] + np.sin(angle) * (half[0] + distance)
    z = center[2] + np.cos(angle) * (half[2] + distance)
    return np.stack([x, np.zeros(16), z], axis=1)
