"""What N agents saw last, so that who stands where it stood is not drawn again: who thought, and who bumped.

Knows nothing of episodes and actions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render import Camera, Renderer

Pictures = tuple[NDArray[np.uint8], NDArray[np.float32]]


class _Seen(NamedTuple):
    """By agent: the scene (N,), -1 before the first; the pose (N, 4), and what was seen from there."""

    scenes: NDArray[np.int64]
    poses: NDArray[np.float64]
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]


class SeenViews:
    """Draws for N agents what they have not just seen. A view follows from scene and pose, so nothing goes stale."""

    def __init__(self, camera: Camera, count: int) -> None:
        self._camera = camera
        shape = (count, camera.height, camera.width)
        self._seen = _Seen(
            np.full(count, -1, np.int64),
            np.zeros((count, 4)),
            np.empty((*shape, 3), np.uint8),
            np.empty((*shape, 1), np.float32),
        )

    def render(
        self,
        renderer: Renderer,
        agents: NDArray[np.int64],
        scene_ids: NDArray[np.int64],
        poses: NDArray[np.float64],
    ) -> Pictures:
        """As `Renderer.render`, rgb and depth of n views; agents: (n,) whose they are, the latest of each the last.

        renderer: the same every time; asked for what is new.
        """
        seen = self._seen
        news = (seen.scenes[agents] != scene_ids) | (seen.poses[agents] != poses).any(axis=1)
        if news.all():
            rgb, depth = renderer.render(scene_ids, poses, self._camera)
        else:
            rgb, depth = np.take(seen.rgb, agents, axis=0), np.take(seen.depth, agents, axis=0)
            if news.any():
                rgb[news], depth[news] = renderer.render(scene_ids[news], poses[news], self._camera)
        # Where an agent has two views, numpy keeps the last.
        seen.scenes[agents], seen.poses[agents] = scene_ids, poses
        seen.rgb[agents], seen.depth[agents] = rgb, depth
        return rgb, depth
