"""Evaluates a policy on every episode of a split, and keeps what happened in each.

Knows policy and thinking env; nothing of how the policy was trained, and nothing of pictures.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.episodes import Episode
from thinknav_sim.scene import Scene
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.actor import Actor
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import PlannerClient
from thinknav_trainer.policy import Policy
from thinknav_trainer.progress import progress_bar
from thinknav_trainer.statistics import bootstrap_interval
from thinknav_trainer.thinking import EpisodeEnd, ThinkingEnv
from thinknav_trainer.thoughts import Thought

SUMMARY_MEASURES = ("success", "spl", "soft_spl", "distance_to_goal", "steps", "thinks", "think_rate")


@dataclass(frozen=True)
class EpisodeRecord:
    """One evaluated episode.

    path: (x, y, z, heading) before each step and after the last one. thoughts: (step, subgoal) for each reply.
    """

    episode_id: str
    scene: str
    category: str
    measures: dict[str, float]
    terms: dict[str, float]
    path: list[list[float]]
    thoughts: list[tuple[int, str]]


@dataclass
class _Track:
    """What an env has done in its episode so far."""

    path: list[list[float]] = field(default_factory=list)
    thoughts: list[tuple[int, str]] = field(default_factory=list)


def evaluate(
    policy: Policy,
    config: TrainConfig,
    scenes: Sequence[Scene],
    episodes: Sequence[Episode],
    planner: PlannerClient | None,
    interruption: Interruption,
    greedy: bool = False,
) -> list[EpisodeRecord]:
    """Play each episode once, actions sampled unless `greedy`; records in the order of `episodes`.

    An interruption ends it early, with fewer records.
    """
    count = min(config.num_envs, len(episodes))
    vector_env = ObjectNavVectorEnv(scenes, episodes, count, config.task, seed=config.seed, order="sequential")
    env = ThinkingEnv(vector_env, config.think, planner)
    actor = Actor(policy, count, config.ppo.precision, config.seed, greedy)
    records: dict[int, EpisodeRecord] = {}
    tracks = [_Track() for _ in range(count)]
    observations = env.reset()
    with progress_bar("evaluating", len(episodes), unit="episodes") as bar:
        while len(records) < len(episodes) and not interruption.requested:
            poses = vector_env.poses
            decision = actor.decide(observations)
            step = env.step(decision.actions.numpy())
            _note(tracks, poses, step.thoughts)
            for end in step.ended:
                track, tracks[end.env] = tracks[end.env], _Track()
                if is_of_own_share(end, count):
                    records.setdefault(end.episode_index, _record(episodes[end.episode_index], end, track))
            actor.advance(decision, step.terminated | step.truncated)
            observations = step.observations
            bar.update(len(records))
    vector_env.close()
    return [records[index] for index in sorted(records)]


def is_of_own_share(end: EpisodeEnd, count: int) -> bool:
    """Whether an episode was played by the env (of `count`) that it was dealt to.

    An env that is through with its share plays on in the others'. If such attempts counted, whichever attempt ended
    first would, and that is the shorter one.
    """
    return end.episode_index % count == end.env


def _note(tracks: list[_Track], poses: NDArray[np.float64], thoughts: Sequence[Thought]) -> None:
    for thought in thoughts:
        if thought.subgoal is not None:
            tracks[thought.env].thoughts.append((len(tracks[thought.env].path), thought.subgoal))
    for track, pose in zip(tracks, poses.round(4).tolist(), strict=True):
        track.path.append(pose)


def _record(episode: Episode, end: EpisodeEnd, track: _Track) -> EpisodeRecord:
    measures = end.measures | {"think_rate": end.measures["thinks"] / end.measures["steps"]}
    return EpisodeRecord(
        episode.episode_id,
        episode.scene_name,
        episode.object_category,
        measures,
        end.terms,
        track.path,
        track.thoughts,
    )


def summarize(records: Sequence[EpisodeRecord]) -> dict[str, dict[str, float]]:
    """Mean and 95 % bootstrap interval over episodes of each measure and reward term."""
    columns = {name: [record.measures[name] for record in records] for name in SUMMARY_MEASURES}
    columns |= {f"reward/{name}": [record.terms[name] for record in records] for name in records[0].terms}
    summary = {}
    for name, values in columns.items():
        low, high = bootstrap_interval(values)
        summary[name] = {"mean": float(np.mean(values)), "low": low, "high": high}
    return summary


def write_evaluation(folder: Path, protocol: Mapping[str, Any], records: Sequence[EpisodeRecord]) -> Path:
    """`result.json` (protocol and summary) and `episodes.jsonl` (every record) in a folder; the path of the first."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "episodes.jsonl").open("w") as file:
        file.writelines(json.dumps(asdict(record)) + "\n" for record in records)
    path = folder / "result.json"
    path.write_text(json.dumps({"protocol": dict(protocol), "summary": summarize(records)}, indent=2) + "\n")
    return path


def read_evaluation(folder: Path) -> tuple[dict[str, Any], list[EpisodeRecord]]:
    """What `write_evaluation` wrote: result and records."""
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    lines = (folder / "episodes.jsonl").read_text().splitlines()
    records = [EpisodeRecord(**json.loads(line)) for line in lines]
    return result, records
