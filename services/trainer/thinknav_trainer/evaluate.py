"""Evaluates an agent on every episode of a split, and keeps what happened in each.

Knows agents and the thinking env; nothing of how a policy was trained, and nothing of pictures.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode
from thinknav_sim.metrics import success_weighted_by_time
from thinknav_sim.scene import Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.actor import Actor
from thinknav_trainer.agents import Agent, MakeAgent, PolicyAgent
from thinknav_trainer.config import ControlName, ThinkConfig, TrainConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.obstacle_memory import ObstacleMemory
from thinknav_trainer.planner import PlannerClient
from thinknav_trainer.policy import Policy
from thinknav_trainer.progress import progress_bar
from thinknav_trainer.records import EpisodeRecord, read_evaluation, summarize, write_evaluation
from thinknav_trainer.thinking import EpisodeEnd, ThinkingEnv
from thinknav_trainer.thoughts import Thought
from thinknav_trainer.threads import torch_threads
from thinknav_trainer.witness import Witness

__all__ = [
    "Clock",
    "Conditions",
    "EpisodeRecord",
    "evaluate",
    "is_of_own_share",
    "play",
    "read_evaluation",
    "summarize",
    "write_evaluation",
]


@dataclass
class _Track:
    """What an env has done in its episode so far."""

    path: list[list[float]] = field(default_factory=list)
    actions: list[int] = field(default_factory=list)
    thoughts: list[tuple[int, str]] = field(default_factory=list)
    planner_seconds: float = 0.0


@dataclass(frozen=True)
class Clock:
    """Seconds that a step and a think would take on a robot. They are stated, so that SOT does not measure our host."""

    step: float = 0.5
    think: float = 1.0


@dataclass(frozen=True)
class Conditions:
    """How episodes are played. task: without regard to thinking, which follows from the planner's presence.

    obstacle_memory: whether the agents have that sensor.
    """

    task: ObjectNavConfig
    think: ThinkConfig
    num_envs: int = 16
    seed: int = 0
    clock: Clock = Clock()
    control: ControlName = "none"
    obstacle_memory: bool = False


def evaluate(
    policy: Policy,
    config: TrainConfig,
    scenes: Sequence[Scene],
    episodes: Sequence[Episode],
    planner: PlannerClient | None,
    interruption: Interruption,
    greedy: bool = False,
    clock: Clock = Clock(),
) -> list[EpisodeRecord]:
    """Play each episode once with a policy, actions sampled unless `greedy`; see `play`."""

    def make_agent(env: ThinkingEnv, seed: int) -> Agent:
        return PolicyAgent(Actor(policy, env.num_envs, config.ppo.precision, seed, greedy))

    control, memory = config.planner.control, config.policy.obstacle_memory
    conditions = Conditions(config.env, config.think, config.num_envs, config.seed, clock, control, memory)
    return play(make_agent, conditions, scenes, episodes, planner, interruption)


@torch_threads(1)
def play(
    make_agent: MakeAgent,
    conditions: Conditions,
    scenes: Sequence[Scene],
    episodes: Sequence[Episode],
    planner: PlannerClient | None,
    interruption: Interruption,
) -> list[EpisodeRecord]:
    """Play each episode once with any agent; records in the order of `episodes`.

    planner: None for an agent that never thinks; no reply of it is withheld. The same arguments give the same records,
    but for planners' seconds.
    An interruption ends it early, with fewer records.
    """
    count = min(conditions.num_envs, len(episodes))
    task = conditions.task.model_copy(update={"think_action": planner is not None})
    vector_env = ObjectNavVectorEnv(scenes, episodes, count, task, seed=conditions.seed, order="sequential")
    think = conditions.think.model_copy(update={"dropout": 0.0})
    memory = ObstacleMemory(count, task) if conditions.obstacle_memory else None
    env = ThinkingEnv(vector_env, think, planner, seed=conditions.seed, control=conditions.control, memory=memory)
    agent = make_agent(env, conditions.seed)
    witness = Witness(vector_env)
    records: dict[int, EpisodeRecord] = {}
    tracks = [_Track() for _ in range(count)]
    observations = env.reset()
    thoughts: list[Thought] = []
    left = np.array([len(range(number, len(episodes), count)) for number in range(count)])
    with progress_bar("evaluating", len(episodes), unit="episodes") as bar:
        while len(records) < len(episodes) and not interruption.requested:
            # Who is through stands still, but where others are told what it hears.
            playing = np.arange(count) if conditions.control == "another" else np.flatnonzero(left)
            poses = vector_env.poses
            actions = agent.actions(observations, thoughts)
            step = env.step(actions[playing], playing)
            done = np.zeros(count, np.bool_)
            done[playing] = step.terminated | step.truncated
            agent.ended(done)
            _note(tracks, playing, poses, actions, step.thoughts)
            for end in step.ended:
                track, tracks[end.env] = tracks[end.env], _Track()
                if is_of_own_share(end, count) and end.episode_index not in records:
                    episode = episodes[end.episode_index]
                    records[end.episode_index] = _record(episode, end, track, witness, conditions.clock)
                    left[end.env] -= 1
            for name, values in step.observations.items():
                observations[name][playing] = values
            thoughts = [thought for thought in step.thoughts if not done[thought.env]]
            bar.update(len(records))
    vector_env.close()
    return [records[index] for index in sorted(records)]


def is_of_own_share(end: EpisodeEnd, count: int) -> bool:
    """Whether an episode was played by the env (of `count`) that it was dealt to.

    An env that is through with its share may play on in the others'. If such attempts counted, whichever attempt ended
    first would, and that is the shorter one.
    """
    return end.episode_index % count == end.env


def _note(
    tracks: list[_Track],
    playing: NDArray[np.int64],
    poses: NDArray[np.float64],
    actions: NDArray[np.int64],
    thoughts: Sequence[Thought],
) -> None:
    for thought in thoughts:
        track = tracks[thought.env]
        track.planner_seconds += thought.seconds
        if thought.subgoal is not None:
            track.thoughts.append((len(track.path), thought.subgoal))
    for env in playing.tolist():
        tracks[env].path.append(poses[env].tolist())
        tracks[env].actions.append(int(actions[env]))


def _record(episode: Episode, end: EpisodeEnd, track: _Track, witness: Witness, clock: Clock) -> EpisodeRecord:
    told = witness.testify(end.episode_index, track.path, track.actions, bool(end.measures["success"]))
    steps, thinks = end.measures["steps"], end.measures["thinks"]
    seconds = (steps - thinks) * clock.step + thinks * clock.think
    sot = success_weighted_by_time(end.measures["success"], told.steps_needed * clock.step, seconds)
    measures = end.measures | {
        "success_paper": told.success_paper,
        "success_viewpoint": told.success_viewpoint,
        "sot": float(sot),
        "steps_needed": float(told.steps_needed),
        "think_rate": thinks / steps,
        "planner_seconds": track.planner_seconds,
    }
    return EpisodeRecord(
        episode_id=episode.episode_id,
        scene=episode.scene_name,
        category=episode.object_category,
        measures=measures,
        terms=end.terms,
        path=np.round(track.path, 4).tolist(),
        actions=track.actions,
        thoughts=track.thoughts,
        first_seen=told.first_seen,
        failure=told.failure,
    )
