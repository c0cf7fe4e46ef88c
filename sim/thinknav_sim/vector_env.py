"""N ObjectNav agents in one process, stepped and drawn as batches: a `gymnasium.vector.VectorEnv`.

A step is: move -> judge -> reward -> start the next episode where one ended -> draw. Any subset of the agents can be
stepped, and the others neither move nor cost anything. Knows nothing of policies or of what a thought is.
"""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Discrete
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from thinknav_sim import metrics
from thinknav_sim.agents import AgentStates
from thinknav_sim.episodes import Episode
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.navigation.kinematics import advance
from thinknav_sim.navigation.tables import distances_to_goal
from thinknav_sim.objectnav import ObjectNavWorld
from thinknav_sim.observations import Observations, compass, gps, observation_space
from thinknav_sim.render import Camera, Renderer, make_renderer
from thinknav_sim.scene import Scene
from thinknav_sim.seen_views import SeenViews
from thinknav_sim.task_config import Action, ObjectNavConfig

StepResult = tuple[Observations, NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]

# What is told of an episode that ended.
_SUMMARY: dict[str, type[np.generic]] = {
    "success": np.bool_,
    "spl": np.float64,
    "soft_spl": np.float64,
    "distance_to_goal": np.float64,
    "steps": np.int64,
    "thinks": np.int64,
    "path_length": np.float64,
    "shortest_path_length": np.float64,
    "collisions": np.int64,
    "timed_out": np.bool_,
}


class _Viewpoints(NamedTuple):
    """From where n observations are taken: agents (n,), poses and start poses (n, 4), the renderer's scenes and goals
    (n,), and how far the last step led, metres (n,).
    """

    agents: NDArray[np.int64]
    poses: NDArray[np.float64]
    starts: NDArray[np.float64]
    scene_ids: NDArray[np.int64]
    goals: NDArray[np.int64]
    moved: NDArray[np.float64]


class ObjectNavVectorEnv(VectorEnv[Observations, NDArray[np.int64], NDArray[Any]]):
    """N agents that each look for an object.

    scenes: with names of their own. episodes: in any of the scenes. order: "random" draws each env's next episode from
    a stream of its own, which depends on `seed`, the env's index and how many episodes it has played, and on nothing
    else; "sequential" gives env i episodes i, i + N, i + 2N ... and begins again at the end. renderer: its
    name, as `make_renderer` has it, or one that no other env draws with.

    An env whose episode ends starts the next within the same step (`AutoresetMode.SAME_STEP`): the observation is then
    the new episode's first and `infos["final_obs"]` has the old one's last. `infos` of a step holds, one row an env:
    reward_terms: {"slack", "progress", "success"} float32, which add up to the reward.
    distance_to_goal: float64 metres, at the end of the step, before any new start.
    episode_index: int64, the episode that the step belongs to.
    _episode: bool, whether it ended; episode: dict of arrays, meaningful where it did: success, timed_out (bool); spl,
    soft_spl, distance_to_goal, path_length, shortest_path_length (float64); steps, thinks, collisions (int64).
    final_obs: object array of the last observations of ended episodes, None elsewhere; _final_obs: where there are
    some.

    Raises EpisodeError, SceneError or RendererUnavailable.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as Gymnasium declares it
        "autoreset_mode": AutoresetMode.SAME_STEP,
        "render_modes": [],
    }

    def __init__(
        self,
        scenes: Sequence[Scene],
        episodes: Sequence[Episode],
        num_envs: int,
        config: ObjectNavConfig = ObjectNavConfig(),
        *,
        seed: int = 0,
        order: Literal["random", "sequential"] = "random",
        renderer: str | Renderer = "auto",
    ) -> None:
        if num_envs < 1:
            raise ValueError(f"num_envs must be at least 1, not {num_envs}")
        if order not in ("random", "sequential"):
            raise ValueError(f"order must be 'random' or 'sequential', not {order!r}")
        self.config = config
        self.num_envs = num_envs
        self.order = order
        self.scenes = tuple(scenes)
        self.episodes = tuple(episodes)
        drawn_by = make_renderer(renderer) if isinstance(renderer, str) else renderer
        self.world = ObjectNavWorld(self.scenes, self.episodes, self.config, drawn_by)
        self.single_observation_space = observation_space(self.config)
        self.single_action_space = Discrete(self.config.num_actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._camera = Camera(
            self.config.width,
            self.config.height,
            self.config.hfov,
            self.config.camera_height,
            (self.config.min_depth, self.config.max_depth),
        )
        # Who may think often stands still; for others, to remember costs more than it saves.
        self._seen = SeenViews(self._camera, num_envs) if self.config.think_action else None
        self._turns = np.zeros(len(Action))
        self._turns[[Action.TURN_LEFT, Action.TURN_RIGHT]] = np.radians([1, -1]) * self.config.turn_angle
        self._lengths = np.zeros(len(Action))
        self._lengths[Action.MOVE_FORWARD] = self.config.forward_step
        self._seed = seed
        self._states = AgentStates.zeros(num_envs)

    # Stepping

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start an episode in every env. With a seed, everything begins again; without one, the next episodes come."""
        if options:
            raise ValueError(f"reset takes no options, not {sorted(options)}")
        if seed is not None:
            self._seed = seed
            self._states.draws[:] = 0
        everyone = np.arange(self.num_envs)
        self._start(everyone)
        infos = {"episode_index": self.episode_indices, "distance_to_goal": self._states.distance.copy()}
        return self._observe(self._viewpoints(everyone)), infos

    def step(self, actions: ArrayLike) -> StepResult:
        """Take one action (N,) in every env."""
        return self.step_subset(np.arange(self.num_envs), actions)

    def step_subset(self, indices: ArrayLike, actions: ArrayLike) -> StepResult:
        """Take one action in each of some envs; the result has a row for each of them, in their order.

        indices: (n,) of different envs. actions: (n,).
        Raises ResetNeeded before the first reset, ValueError for indices or actions that are not there.
        """
        agents, acts = self._check(indices, actions)
        states = self._states
        before = states.distance[agents]
        self._move(agents, acts)
        states.steps[agents] += 1
        states.thinks[agents] += acts == Action.THINK
        terminated = acts == Action.STOP
        truncated = ~terminated & (states.steps[agents] >= self.config.max_steps)
        ended = terminated | truncated
        success = self._judge(agents, terminated)
        terms = {
            "slack": np.full(len(agents), self.config.slack_reward, np.float32),
            "progress": (before - states.distance[agents]).astype(np.float32),
            "success": np.where(success, self.config.success_reward, 0.0).astype(np.float32),
        }
        infos: dict[str, Any] = {
            "reward_terms": terms,
            "distance_to_goal": states.distance[agents],
            "episode_index": states.episodes[agents],
            "episode": self._summary(agents, ended, success, truncated),
            "_episode": ended,
            "final_obs": np.full(len(agents), None, object),
            "_final_obs": ended.copy(),
        }
        observations = self._observe_and_restart(agents, ended, infos["final_obs"])
        return observations, terms["slack"] + terms["progress"] + terms["success"], terminated, truncated, infos

    def _check(self, indices: ArrayLike, actions: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        agents, acts = np.atleast_1d(np.asarray(indices)), np.atleast_1d(np.asarray(actions))
        if agents.ndim != 1 or acts.shape != agents.shape:
            raise ValueError(f"{agents.shape} env indices do not go with actions of shape {acts.shape}")
        for name, array, size in (("env index", agents, self.num_envs), ("action", acts, self.config.num_actions)):
            if not array.size:
                continue
            if array.dtype.kind not in "iu":
                raise ValueError(f"an {name} must be an integer, not {array.dtype}")
            if array.min() < 0 or array.max() >= size:
                raise ValueError(f"{name} {array[(array < 0) | (array >= size)][0]} is not one of 0..{size - 1}")
        if agents.size and np.bincount(agents.astype(np.int64)).max() > 1:
            raise ValueError(f"env indices {agents.tolist()} name an env twice")
        if agents.size and not self._states.draws[agents].all():
            raise ResetNeeded("call reset() before step()")
        return agents.astype(np.int64), acts.astype(np.int64)

    def _move(self, agents: NDArray[np.int64], acts: NDArray[np.int64]) -> None:
        states = self._states
        before = states.path_length[agents]
        advance(
            self.world.grids,
            self.world.table.scene[states.episodes],
            states.poses,
            agents,
            self._turns[acts],
            self._lengths[acts],
            self.config.allow_sliding,
            states.path_length,
            states.collisions,
        )
        states.moved[agents] = states.path_length[agents] - before
        self._measure(agents)

    def _measure(self, agents: NDArray[np.int64]) -> None:
        states, world = self._states, self.world
        fields = world.table.field[states.episodes]
        distances_to_goal(world.grids, world.fields, fields, states.poses, agents, states.distance)

    def _judge(self, agents: NDArray[np.int64], stopped: NDArray[np.bool_]) -> NDArray[np.bool_]:
        states = self._states
        success = np.zeros(len(agents), np.bool_)
        for row in np.flatnonzero(stopped):
            agent = agents[row]
            success[row] = self.world.is_success(
                int(states.episodes[agent]), states.poses[agent], float(states.distance[agent])
            )
        return success

    def _summary(
        self,
        agents: NDArray[np.int64],
        ended: NDArray[np.bool_],
        success: NDArray[np.bool_],
        truncated: NDArray[np.bool_],
    ) -> dict[str, NDArray[Any]]:
        if not ended.any():
            return {name: np.zeros(len(agents), kind) for name, kind in _SUMMARY.items()}
        states = self._states
        distance, shortest = states.distance[agents], states.shortest[agents]
        travelled = states.path_length[agents]
        summary: dict[str, NDArray[Any]] = {
            "success": success,
            "spl": metrics.spl(success, shortest, travelled),
            "soft_spl": metrics.soft_spl(distance, shortest, travelled),
            "distance_to_goal": distance,
            "steps": states.steps[agents],
            "thinks": states.thinks[agents],
            "path_length": travelled,
            "shortest_path_length": shortest,
            "collisions": states.collisions[agents],
            "timed_out": truncated.copy(),
        }
        return {name: np.where(ended, values, np.zeros_like(values)) for name, values in summary.items()}

    # Episodes

    def _start(self, agents: NDArray[np.int64]) -> None:
        states = self._states
        chosen = np.array([self._next_episode(int(agent)) for agent in agents], np.int64)
        states.start(agents, chosen, self.world.table.start[chosen])
        self._measure(agents)
        states.shortest[agents] = states.distance[agents]

    def _next_episode(self, agent: int) -> int:
        played = int(self._states.draws[agent])
        if self.order == "sequential":
            return (agent + played * self.num_envs) % len(self.episodes)
        return int(np.random.default_rng((self._seed, agent, played)).integers(len(self.episodes)))

    # Observations

    def _observe_and_restart(
        self, agents: NDArray[np.int64], ended: NDArray[np.bool_], final_obs: NDArray[np.object_]
    ) -> Observations:
        """Observe, starting anew where an episode ended; its last observation goes into final_obs. One draw for all."""
        if not ended.any():
            return self._observe(self._viewpoints(agents))
        last = self._viewpoints(agents[ended])
        self._start(agents[ended])
        now = self._viewpoints(agents)
        drawn = self._observe(_Viewpoints(*(np.concatenate(pair) for pair in zip(last, now, strict=True))))
        for row, index in enumerate(np.flatnonzero(ended)):
            final_obs[index] = {name: values[row].copy() for name, values in drawn.items()}
        return {name: values[len(last.poses) :] for name, values in drawn.items()}

    def _viewpoints(self, agents: NDArray[np.int64]) -> _Viewpoints:
        table = self.world.table
        episodes = self._states.episodes[agents]
        return _Viewpoints(
            agents=agents,
            poses=self._states.poses[agents],
            starts=table.start[episodes],
            scene_ids=self.world.scene_ids[table.scene[episodes]],
            goals=table.goal[episodes],
            moved=self._states.moved[agents],
        )

    def _observe(self, views: _Viewpoints) -> Observations:
        if self._seen is None:
            rgb, depth = self.world.renderer.render(views.scene_ids, views.poses, self._camera)
        else:
            rgb, depth = self._seen.render(self.world.renderer, views.agents, views.scene_ids, views.poses)
        return {
            "rgb": rgb,
            "depth": depth,
            "gps": gps(views.poses, views.starts),
            "compass": compass(views.poses, views.starts),
            "moved": views.moved[:, None].astype(np.float32),
            "objectgoal": views.goals[:, None],
        }

    def observations(self, indices: ArrayLike | None = None) -> Observations:
        """What some envs (all unless given) observe now, without stepping them; for one who resumes."""
        agents = np.arange(self.num_envs) if indices is None else np.asarray(indices, np.int64)
        return self._observe(self._viewpoints(agents))

    def frames(self, indices: ArrayLike, width: int, height: int) -> NDArray[np.uint8]:
        """What some envs see now, in images of another size: (n, height, width, 3) uint8; the same horizontal view."""
        views = self._viewpoints(np.asarray(indices, np.int64))
        camera = Camera(width, height, self.config.hfov, self.config.camera_height)
        return self.world.renderer.render(views.scene_ids, views.poses, camera)[0]

    # State

    @property
    def poses(self) -> NDArray[np.float64]:
        """(N, 4) where the agents are."""
        return self._states.poses.copy()

    @property
    def episode_indices(self) -> NDArray[np.int64]:
        """(N,) which of `episodes` the envs play."""
        return self._states.episodes.copy()

    def would_succeed(self) -> NDArray[np.bool_]:
        """(N,) whether each agent would succeed by stopping now. Privileged: no agent is told in the task."""
        everyone = np.arange(self.num_envs)
        return self._judge(everyone, np.ones(self.num_envs, np.bool_))

    def grid(self, scene_index: int) -> NavigationGrid:
        """The navigation grid of one of `scenes`."""
        return self.world.grid(scene_index)

    def distance_field(self, scene_index: int, category: str) -> NDArray[np.float32]:
        """(rows, cols) walking distances to a category's success zone in one of `scenes`; inf where no path leads."""
        return self.world.goal(scene_index, category).distance

    def state_dict(self) -> dict[str, Any]:
        """All that it takes to go on from here in an env of the same scenes, episodes and config: numbers, arrays."""
        return {"seed": self._seed, "num_episodes": len(self.episodes), "agents": self._states.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on from where `state_dict` was taken. Raises ValueError when that was another env."""
        if state["num_episodes"] != len(self.episodes):
            raise ValueError(
                f"the saved state is of an env of {state['num_episodes']} episodes; this one has {len(self.episodes)}"
            )
        self._states.load_state_dict(state["agents"])
        self._seed = int(state["seed"])

    def close_extras(self) -> None:
        """Give the scenes' memory back."""
        self.world.close()
