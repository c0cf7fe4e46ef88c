"""The frames that N agents have seen and may show a planner beside the present one (`think.context`).

Which of them are worth keeping, `views` knows; this encodes them, and forgets them with their episode.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import Frame
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.config import ThinkConfig
from thinknav_trainer.planner import encode_frame
from thinknav_trainer.planner_frames import PlannerFrames
from thinknav_trainer.views import RecentViews


class RecentFrames:
    """Up to `config.context` - 1 frames of each agent, kept as they travel: encoded once, sent often."""

    def __init__(self, env: ObjectNavVectorEnv, frames: PlannerFrames, config: ThinkConfig) -> None:
        self._env = env
        self._frames = frames
        self._config = config
        self._views: list[RecentViews[Frame]] = [RecentViews(config.context - 1) for _ in range(env.num_envs)]

    def look(self, agents: Iterable[int]) -> None:
        """Some agents look around them; where that is a new view, its frame is kept."""
        if self._config.context == 1:
            return
        poses = self._env.poses
        new = [agent for agent in agents if self._views[agent].is_new(poses[agent])]
        if not new:
            return
        for agent, frame in zip(new, self._frames.of(np.array(new)), strict=True):
            self._views[agent].see(poses[agent], encode_frame(frame, self._config.frame_encoding))

    def before(self, agent: int, pose: NDArray[np.float64]) -> tuple[Frame, ...]:
        """An agent's frames other than the one from its pose (4,), oldest first, with headings relative to it."""
        views = self._views[agent].before(pose)
        return tuple(frame.model_copy(update={"heading": heading}) for frame, heading in views)

    def forget(self, agents: Iterable[int]) -> None:
        """The episodes of some agents have ended."""
        for agent in agents:
            self._views[agent].forget()

    def state_dict(self) -> list[list[dict[str, Any]]]:
        """Every agent's frames and the poses that they were seen from."""
        return [[{"frame": _pack(kept.view), "pose": kept.pose.copy()} for kept in views.kept] for views in self._views]

    def load_state_dict(self, state: list[list[dict[str, Any]]]) -> None:
        """Remember what `state_dict` gave."""
        self.forget(range(len(self._views)))
        for views, kept in zip(self._views, state, strict=True):
            for item in kept:
                views.see(item["pose"], _unpack(item["frame"]))


def _pack(frame: Frame) -> dict[str, Any]:
    """As plain values; bytes as an array, which checkpoints take."""
    return frame.model_dump() | {"data": np.frombuffer(frame.data, np.uint8).copy()}


def _unpack(values: dict[str, Any]) -> Frame:
    return Frame(**{**values, "data": values["data"].tobytes()})
