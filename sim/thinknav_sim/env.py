"""One ObjectNav agent as a plain `gymnasium.Env`, "ThinkNav/ObjectNav-v0": a thin face of the vector env."""

from collections.abc import Sequence
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode, make_episodes
from thinknav_sim.homes import generate_home
from thinknav_sim.objectnav import make_grid
from thinknav_sim.observations import Observations
from thinknav_sim.render import make_renderer
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv

ENV_ID = "ThinkNav/ObjectNav-v0"
DEFAULT_EPISODES = 100


def default_task(config: ObjectNavConfig = ObjectNavConfig()) -> tuple[tuple[Scene, ...], tuple[Episode, ...]]:
    """A generated home and episodes in it, for those who bring none."""
    home, renderer = generate_home(seed=0), make_renderer()
    grid = make_grid(home, renderer, config)
    return (home,), make_episodes(home, grid, DEFAULT_EPISODES, seed=0, config=config, renderer=renderer)


def make_vector_env(
    num_envs: int,
    scenes: Sequence[Scene] = (),
    episodes: Sequence[Episode] = (),
    config: ObjectNavConfig = ObjectNavConfig(),
    **options: Any,
) -> ObjectNavVectorEnv:
    """What `gymnasium.make_vec` calls: an `ObjectNavVectorEnv`, of the default task when given none."""
    if not scenes and not episodes:
        scenes, episodes = default_task(config)
    return ObjectNavVectorEnv(scenes, episodes, num_envs, config, **options)


class ObjectNavEnv(gymnasium.Env[dict[str, NDArray[Any]], np.int64]):
    """One agent that looks for an object. Arguments and infos are those of `ObjectNavVectorEnv`, without the first
    axis.

    `reset(seed)` begins the order of episodes again; `reset()` goes on to the next. With render_mode "rgb_array",
    `render()` gives what the agent sees.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": ["rgb_array"],
        "render_fps": 10,
    }

    def __init__(
        self,
        scenes: Sequence[Scene] = (),
        episodes: Sequence[Episode] = (),
        config: ObjectNavConfig = ObjectNavConfig(),
        *,
        seed: int = 0,
        order: Literal["random", "sequential"] = "random",
        renderer: str = "auto",
        render_mode: Literal["rgb_array"] | None = None,
    ) -> None:
        self.vector_env = make_vector_env(1, scenes, episodes, config, seed=seed, order=order, renderer=renderer)
        self.observation_space = self.vector_env.single_observation_space
        self.action_space = self.vector_env.single_action_space
        self.render_mode = render_mode
        self._next_is_ready = False
        self._needs_reset = True
        self._last_frame: NDArray[np.uint8]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Start the next episode, or with a seed the first."""
        super().reset(seed=seed)
        # The vector env has gone on to the next episode when the last one ended.
        if self._next_is_ready and seed is None and not options:
            observations = self.vector_env.observations()
        else:
            observations, _ = self.vector_env.reset(seed=seed, options=options)
        self._next_is_ready = self._needs_reset = False
        return _first(observations), {"episode_index": int(self.vector_env.episode_indices[0])}

    def step(self, action: np.int64 | int) -> tuple[dict[str, NDArray[Any]], float, bool, bool, dict[str, Any]]:
        """Take one action. `info["episode"]` sums the episode up when it has ended.

        Gymnasium's RecordEpisodeStatistics writes to this key unless told otherwise: `stats_key="stats"`.
        """
        if self._needs_reset:
            raise ResetNeeded("call reset() before step()")
        observations, rewards, terminations, truncations, infos = self.vector_env.step([int(action)])
        self._next_is_ready = self._needs_reset = bool(infos["_episode"][0])
        observation = infos["final_obs"][0] if self._needs_reset else _first(observations)
        self._last_frame = observation["rgb"]
        info: dict[str, Any] = {
            "reward_terms": {name: float(term[0]) for name, term in infos["reward_terms"].items()},
            "distance_to_goal": float(infos["distance_to_goal"][0]),
            "episode_index": int(infos["episode_index"][0]),
        }
        if self._needs_reset:
            info["episode"] = {name: values[0].item() for name, values in infos["episode"].items()}
        return observation, float(rewards[0]), bool(terminations[0]), bool(truncations[0]), info

    def render(self) -> NDArray[np.uint8] | None:
        """What the agent sees, (H, W, 3), if made with render_mode "rgb_array"."""
        if self.render_mode is None:
            return None
        if self._next_is_ready:  # the vector env has gone on, but not its user
            return self._last_frame.copy()
        config = self.vector_env.config
        frame: NDArray[np.uint8] = self.vector_env.frames([0], config.width, config.height)[0]
        return frame

    def close(self) -> None:
        """Give the scenes' memory back."""
        self.vector_env.close()


def _first(observations: Observations) -> dict[str, NDArray[Any]]:
    return {name: values[0] for name, values in observations.items()}
