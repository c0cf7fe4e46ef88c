"""The story of a run: collect, learn, log, save, until the step budget is spent.

`train` is the whole of it; the functions below it are its sentences.
"""

import logging
import math
import time
from collections.abc import Callable, Iterable
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
from thinknav_trainer.asking import AskApart, Asking, AskTogether
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.collector import RECENT_EPISODES, Collector
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.demonstrators import MakeDemonstrator, think_and_obey
from thinknav_trainer.dumps import NotFinite, TrainingDiverged
from thinknav_trainer.evaluate import evaluate
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import PlannerClient
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.progress import progress_bar
from thinknav_trainer.recording import AskRecorded, Recording
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import Homes
from thinknav_trainer.thinking import EpisodeEnd, ThinkingEnv
from thinknav_trainer.thought_scale import centre_and_scale, typical_sentences
from thinknav_trainer.vision import EmbeddingSpaceError
from thinknav_trainer.warm_start import Cloner, Demonstrations

logger = logging.getLogger(__name__)

VALIDATED = ("success", "spl", "soft_spl", "distance_to_goal", "think_rate")
SHORT_EPISODE_STEPS = 10  # a policy whose episodes are shorter has learnt to stop at once, and nothing else


@dataclass
class Session:
    """What a run is made of while it runs. best: the highest SPL on validation episodes so far."""

    env: ThinkingEnv
    learner: PPO
    actor: Actor
    collector: Collector
    planner: PlannerClient | None
    steps: int = 0
    best: float = -math.inf
    warned_of_short_episodes: bool = False


def train(
    run: Run,
    homes: Homes,
    planner: PlannerClient | None,
    interruption: Interruption,
    resume_from: Checkpoint | None = None,
    recording: Recording | None = None,
    demonstrator: MakeDemonstrator = think_and_obey,
) -> Path:
    """Collect, learn, log, save, until the step budget is spent or the user interrupts; the last checkpoint's path.

    With a warm start, imitate first.
    recording: replies come from it, in its order, and `planner` is the one that it recorded. demonstrator: whom the
    policy imitates in `config.warm_start`.
    Raises TrainingDiverged, and Unavailable when the planner has been gone too long.
    """
    config = run.config
    session = open_session(config, homes, planner, resume_from, recording)
    log_planner(run, session)
    if resume_from is None:
        run.checkpoint(snapshot(session, config))
    if session.steps < config.warm_start.steps:
        imitate(session, run, demonstrator, interruption)
    started = time.monotonic()
    due = session.steps + config.checkpoint_every
    with progress_bar("training", config.total_steps, session.steps) as bar:
        while session.steps < config.total_steps and not interruption.requested:
            losses, transitions = improve(session, run)
            metrics = log_update(session, run, losses, transitions)
            bar.update(session.steps, f"success {metrics.get('success', 0):.2f}")
            if session.steps >= due:
                validate(session, run, homes, interruption)
                run.checkpoint(snapshot(session, config))
                due = session.steps + config.checkpoint_every
            if config.max_minutes is not None and time.monotonic() - started >= 60 * config.max_minutes:
                logger.info("max_minutes is over after %d steps", session.steps)
                break
    return run.checkpoint(snapshot(session, config))


def improve(session: Session, run: Run) -> tuple[dict[str, float], int]:
    """Collect once and learn from it: the losses and the number of transitions. Raises TrainingDiverged."""
    session.env.share = session.steps / run.config.total_steps
    try:
        rollout = session.collector.collect()
        with session.collector.stopwatch("learn"):
            losses = session.learner.update(rollout, remaining=1 - session.env.share)
    except NotFinite as error:
        config = run.config.model_dump(mode="json")
        path = run.dump(session.steps, {"what": str(error), "config": config, **error.evidence})
        raise TrainingDiverged(
            f"not finite after {session.steps} steps: {error}; to see it again: thinknav reproduce {path}"
        ) from error
    return losses, len(rollout)


def imitate(session: Session, run: Run, make: MakeDemonstrator, interruption: Interruption) -> None:
    """The warm start: demonstrations and cloning in turn, then new episodes for PPO, and a checkpoint."""
    config = run.config
    demonstrator = make(session.env, config.seed)
    shown = Demonstrations(session.env, session.actor, demonstrator, session.collector, config.ppo)
    cloner = Cloner(session.learner.policy, config.warm_start, config.ppo, config.seed)
    with progress_bar("imitating", config.warm_start.steps, session.steps) as bar:
        while session.steps < min(config.warm_start.steps, config.total_steps) and not interruption.requested:
            rollout = shown.collect()
            with session.collector.stopwatch("learn"):
                losses = cloner.update(rollout)
            log_update(session, run, losses, len(rollout))
            bar.update(session.steps, f"accuracy {losses['cloning_accuracy']:.2f}")
    session.collector.restart()
    run.checkpoint(snapshot(session, config))


def log_update(session: Session, run: Run, losses: dict[str, float], transitions: int) -> dict[str, float]:
    """Count the steps of an update and write everything down about it; the metrics."""
    session.steps += transitions
    metrics, timing = summarize(session, losses, transitions)
    run.log(session.steps, metrics, timing)
    run.log_thoughts(session.steps, session.collector.thoughts)
    run.log_texts(session.steps, session.env.texts)
    return metrics


def validate(session: Session, run: Run, homes: Homes, interruption: Interruption) -> None:
    """Play the validation episodes, if there are any, and keep the checkpoint if it is the best so far."""
    if not homes.validation:
        return
    config, policy = run.config, session.learner.policy
    records = evaluate(policy, config, homes.scenes, homes.validation, session.planner, interruption)
    if interruption.requested:
        return
    measures = {name: float(np.mean([record.measures[name] for record in records])) for name in VALIDATED}
    run.log_validation(session.steps, measures)
    if measures["spl"] > session.best:
        session.best = measures["spl"]
        run.keep_best(snapshot(session, config))


def log_planner(run: Run, session: Session) -> None:
    """Who answers in this run, and how it embeds; that is what it takes to replay it."""
    if session.planner is not None:
        run.note_planner(session.planner.info)
        run.log_texts(session.steps, session.env.texts)


def open_session(
    config: TrainConfig,
    homes: Homes,
    planner: PlannerClient | None,
    resume_from: Checkpoint | None = None,
    recording: Recording | None = None,
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
    env = ThinkingEnv(vector_env, config.think, planner, _asking(config, recording), config.ppo.gamma)
    torch.manual_seed(config.seed)
    policy = Policy(observation_shape(config, planner), config.network)
    if planner is not None and resume_from is None:
        centre, scale = centre_and_scale(env.embed(typical_sentences()))
        policy.scale_thoughts(torch.from_numpy(centre), scale)
    actor = Actor(policy, config.num_envs, config.ppo.precision, config.seed)
    session = Session(env, PPO(policy, config.ppo, config.seed), actor, Collector(env, actor, config.ppo), planner)
    if resume_from is not None:
        policy.load_state_dict(resume_from.policy)
        session.learner.load_state_dict(resume_from.state["learner"])
        session.collector.load_state_dict(resume_from.state["collector"])
        session.steps = resume_from.steps
        session.best = resume_from.state["best"]
    return session


def _asking(config: TrainConfig, recording: Recording | None) -> Callable[[PlannerClient], Asking]:
    if recording is not None:
        return lambda _: AskRecorded(recording)
    return AskTogether if config.deterministic else AskApart


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
        state={
            "learner": session.learner.state_dict(),
            "collector": session.collector.state_dict(),
            "best": session.best,
        },
    )


def summarize(
    session: Session, losses: dict[str, float], transitions: int
) -> tuple[dict[str, float], dict[str, float]]:
    """Of one update: episodes' means over the most recent ones, losses, thoughts; and, apart, where the time went."""
    metrics: dict[str, float] = episode_means(session.collector.recent)
    metrics |= {f"losses/{name}": value for name, value in losses.items()}
    metrics |= {f"thoughts/{name}": float(value) for name, value in vars(session.env.counts).items()}
    metrics["episodes"] = session.collector.episodes_ended
    _warn_of_short_episodes(session, metrics)
    seconds = session.collector.stopwatch.take()
    timing = {f"time/{name}": value for name, value in seconds.items()}
    return metrics, timing | {"steps_per_s": transitions / sum(seconds.values())}


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
