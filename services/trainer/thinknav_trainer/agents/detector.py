"""Privileged: an object detector that never errs. It tells which pixels show the goal, and nothing else."""

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.render import Camera
from thinknav_sim.render.renderer import NOTHING_DEPTH
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.visible import ObjectBoxes, frame_points

# A goal of fewer of the thousand pixels that are looked at is not made out.
LEAST_PIXELS = 3


class CategoryDetector:
    """Looks for the goal of each of an env's agents in what that agent sees."""

    def __init__(self, env: ObjectNavVectorEnv) -> None:
        self._env = env
        config = env.config
        self._camera = Camera(config.width, config.height, config.hfov, config.camera_height)
        self._boxes = [ObjectBoxes(scene) for scene in env.scenes]
        self._categories = [np.array([found.category for found in scene.objects]) for scene in env.scenes]

    def detect(self, depth: NDArray[np.float32]) -> list[NDArray[np.float64]]:
        """For each env where the pixels lie that show its goal: metres to the left and ahead (K, 2); K is 0 for none.

        depth: (N, H, W, 1), as it is observed now; what is out of the sensor's range is not made out.
        """
        env, config = self._env, self._env.config
        read = depth[..., 0]
        metres = config.min_depth + read * (config.max_depth - config.min_depth)
        in_range = np.where((read > 0) & (read < 1), metres, np.float32(NOTHING_DEPTH))
        detected = []
        for frame, index in zip(frame_points(env.poses, in_range, self._camera), env.episode_indices, strict=True):
            scene = int(env.world.table.scene[index])
            owners = self._boxes[scene].owners(frame.points)
            categories = self._categories[scene]
            shown = (owners >= 0) & (categories[owners] == env.episodes[index].object_category)
            places = np.stack([frame.left[shown], frame.forward[shown]], axis=-1).astype(np.float64)
            detected.append(places if len(places) >= LEAST_PIXELS else np.empty((0, 2)))
        return detected
