"""The story of a run: collect, learn, log, save, until the step budget is spent.

`train` is the whole of it; the functions below it are its sentences.
"""

import dataclasses
import logging
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from thinknav_models.clip import shipped_text_encoder
from thinknav_sim.render import set_render_threads
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.actor import Actor
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.collector import RECENT_EPISODES, Collector
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import PlannerClient
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.progress import progress_bar
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import Homes
from thinknav_trainer.thinking import EpisodeEnd, ThinkingEnv
from thinknav_trainer.vision import EmbeddingSpaceError

logger = logging.getLogger(__name__)

SHORT_EPISODE_STEPS = 10  # a policy whose episodes are shorter has learnt to stop at once, and nothing else


@dataclass
class Session:
    """What a run is made of while it runs."""

    env: ThinkingEnv
    learner: PPO
    collector: Collector
    planner: PlannerClient | None
    steps: int = 0
    warned_of_short_episodes: bool = False


def train(
    run: Run,
    homes: Homes,
    planner: PlannerClient | None,
    interruption: Interruption,
    resume_from: Checkpoint | None = None,
) -> Path:
    """Collect, learn, log, save, until the step budget is spent or the user interrupts; the last checkpoint's path."""
    config = run.config
    session = open_session(config, homes, planner, resume_from)
    if resume_from is None:
        run.checkpoint(snapshot(session, config))
    started = time.monotonic()
    due = session.steps + config.checkpoint_every
    with progress_bar("training", config.total_steps, session.steps) as bar:
        while session.steps < config.total_steps and not interruption.requested:
            rollout = session.collector.collect()
            with session.collector.stopwatch("learn"):
                losses = session.learner.update(rollout, remaining=1 - session.steps / config.total_steps)
            session.steps += len(rollout)
            metrics = summarize(session, losses, len(rollout))
            run.log(session.steps, metrics)
            run.log_thoughts(session.steps, map(dataclasses.asdict, session.collector.thoughts))
            bar.update(session.steps, f"success {metrics.get('success', 0):.2f}")
            if session.steps >= due:
                run.checkpoint(snapshot(session, config))
                due = session.steps + config.checkpoint_every
            if config.max_minutes is not None and time.monotonic() - started >= 60 * config.max_minutes:
                logger.info("max_minutes is over after %d steps", session.steps)
                break
    return run.checkpoint(snapshot(session, config))


def open_session(
    config: TrainConfig, homes: Homes, planner: PlannerClient | None, resume_from: Checkpoint | None = None
) -> Session:
    """Build env, policy, learner and collector, and put them where a checkpoint left them. Raises CheckpointError or
    EmbeddingSpaceError.
    """
    if config.threads:
        torch.set_num_threads(config.threads)
        set_render_threads(config.threads)
    require_shared_space(config, planner)
    if resume_from is not None:
        resume_from.require(action_space(config), embedding_space(planner))
    vector_env = ObjectNavVectorEnv(
        homes.scenes, homes.train, config.num_envs, config.task, seed=config.seed, order="random"
    )
    env = ThinkingEnv(vector_env, config.think, planner)
    torch.manual_seed(config.seed)
    policy = Policy(observation_shape(config, planner), config.policy)
    actor = Actor(policy, config.num_envs, config.ppo.precision, config.seed)
    session = Session(env, PPO(policy, config.ppo, config.seed), Collector(env, actor, config.ppo), planner)
    if resume_from is not None:
        policy.load_state_dict(resume_from.policy)
        session.learner.load_state_dict(resume_from.state["learner"])
        session.collector.load_state_dict(resume_from.state["collector"])
        session.steps = resume_from.steps
    return session


def action_space(config: TrainConfig) -> tuple[str, ...]:
    """Names of the actions, in order."""
    actions = [action for action in Action if config.task.think_action or action != Action.THINK]
    return tuple(action.name.lower() for action in actions)


def embedding_space(planner: PlannerClient | None) -> str | None:
    """Of the thoughts that a policy sees, None without a planner."""
    return None if planner is None else str(planner.info.embedding_space)


def require_shared_space(config: TrainConfig, planner: PlannerClient | None) -> None:
    """Refuse a policy that sees through one CLIP and reads the thoughts of another. Raises EmbeddingSpaceError."""
    if planner is None or config.policy.image_encoder != "clip":
        return
    own = shipped_text_encoder().space
    if planner.info.embedding_space != str(own):
        raise EmbeddingSpaceError(
            f"the policy's image encoder is of embedding space {own}, the service's text encoder of "
            f"{planner.info.embedding_space}; start the service with the other text encoder, or set "
            "policy.image_encoder=learnt"
        )


def observation_shape(config: TrainConfig, planner: PlannerClient | None) -> ObservationShape:
    """What the policy must fit."""
    thought_size = 0 if planner is None else planner.info.embedding_dimension
    return ObservationShape(config.env.height, config.env.width, len(action_space(config)), thought_size)


def snapshot(session: Session, config: TrainConfig) -> Checkpoint:
    """All of a run at this moment."""
    return Checkpoint(
        config=config.model_dump(mode="json"),
        action_space=action_space(config),
        embedding_space=embedding_space(session.planner),
        thought_size=session.learner.policy.shape.thought_size,
        steps=session.steps,
        policy=session.learner.policy.state_dict(),
        state={"learner": session.learner.state_dict(), "collector": session.collector.state_dict()},
    )


def summarize(session: Session, losses: dict[str, float], transitions: int) -> dict[str, float]:
    """The metrics of one update: episodes' means over the most recent ones, losses, where the time went."""
    seconds = session.collector.stopwatch.take()
    metrics: dict[str, float] = episode_means(session.collector.recent)
    metrics |= {f"losses/{name}": value for name, value in losses.items()}
    metrics |= {f"time/{name}": value for name, value in seconds.items()}
    metrics |= {f"thoughts/{name}": float(value) for name, value in vars(session.env.counts).items()}
    metrics["steps_per_s"] = transitions / sum(seconds.values())
    metrics["episodes"] = session.collector.episodes_ended
    _warn_of_short_episodes(session, metrics)
    return metrics


def _warn_of_short_episodes(session: Session, metrics: dict[str, float]) -> None:
    """Once a run: a policy that stops at once earns nothing, and may never learn otherwise."""
    steps = metrics.get("episode_steps", math.inf)
    full = len(session.collector.recent) == RECENT_EPISODES
    if full and steps < SHORT_EPISODE_STEPS and not session.warned_of_short_episodes:
        session.warned_of_short_episodes = True
        logger.warning(
            "the last %d episodes lasted %.0f steps: the policy stops at once; if that goes on, see policy.stop_bias",
            RECENT_EPISODES,
            steps,
        )


def episode_means(episodes: Iterable[EpisodeEnd]) -> dict[str, float]:
    """Means over episodes: measures by name, think_rate, reward terms as reward/<term>. Empty for none."""
    ends = list(episodes)
    if not ends:
        return {}
    rows: list[dict[str, Any]] = [
        end.measures
        | {"think_rate": end.measures["thinks"] / end.measures["steps"]}
        | {f"reward/{name}": value for name, value in end.terms.items()}
        for end in ends
    ]
    return {
        ("episode_steps" if name == "steps" else name): float(np.mean([row[name] for row in rows])) for name in rows[0]
    }
