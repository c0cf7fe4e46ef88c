"""What is where in a picture, in coarse cells: which goals, and how far away things are. Read off depth and boxes.

It gives the trunk of the subgoal VLM something to learn in every cell of every picture, where a sentence says one thing
about the whole.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render import Camera
from thinknav_sim.scene import GOAL_CATEGORIES, Scene

CELLS = 8  # along each side, as many as the trunk's features have
_RAYS = 2 * CELLS
_GROWN_M = 0.03
_FLOOR_M = 0.025  # what lies no higher over a box's bottom is the floor it stands on


def surroundings(
    scene: Scene, poses: NDArray[np.float64], depth: NDArray[np.float32], camera: Camera
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """For N pictures: the share of each cell that each goal category fills (N, 8, 8, 6), and log(1 + metres) (N, 8, 8).

    poses: (N, 4). depth: (N, H, W) metres along the optical axis, of this camera.
    """
    pixel = ((np.arange(_RAYS) + 0.5) * camera.height / _RAYS).astype(np.int64)
    column = ((np.arange(_RAYS) + 0.5) * camera.width / _RAYS).astype(np.int64)
    forward = depth[:, pixel[:, None], column]
    left = forward * ((camera.width / 2 - column - 0.5) / camera.focal_length)
    up = forward * ((camera.height / 2 - pixel - 0.5) / camera.focal_length)[:, None]
    x, y, z, heading = (poses[:, axis, None, None] for axis in range(4))
    points = np.stack(
        [
            x - np.cos(heading) * left - np.sin(heading) * forward,
            y + camera.elevation + up,
            z + np.sin(heading) * left - np.cos(heading) * forward,
        ],
        axis=-1,
    ).astype(np.float32)
    hits = np.zeros((*forward.shape, len(GOAL_CATEGORIES)), np.float32)
    for number, category in enumerate(GOAL_CATEGORIES):
        for instance in scene.objects_of(category):
            low = (instance.box.low - [_GROWN_M, -_FLOOR_M, _GROWN_M]).astype(np.float32)
            high = (instance.box.high + _GROWN_M).astype(np.float32)
            hits[..., number] += ((points >= low) & (points <= high)).all(axis=-1)
    shares = np.minimum(hits, 1.0).reshape(len(poses), CELLS, 2, CELLS, 2, -1).mean(axis=(2, 4))
    farness = np.log1p(forward).reshape(len(poses), CELLS, 2, CELLS, 2).mean(axis=(2, 4)) / math.log(10)
    return shares, farness
