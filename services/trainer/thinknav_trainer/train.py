"""The story of a run: collect, learn, log, save, until the step budget is spent.

`train` is the whole of it; the functions below it are its sentences. Several workers may tell it together, each with
envs of its own: they learn as one, and count their steps together.
"""

import logging
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

import numpy as np
import torch

from thinknav_models.clip import shipped_text_encoder
from thinknav_sim.render import WarpRenderer, make_renderer, set_render_threads
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.actor import Actor
from thinknav_trainer.agents import DEMONSTRATORS
from thinknav_trainer.asking import AskApart, Asking, AskTogether
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.collector import RECENT_EPISODES, Collector
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.control import REPLIES_KEPT
from thinknav_trainer.device import find_device
from thinknav_trainer.dumps import NotFinite, TrainingDiverged
from thinknav_trainer.evaluate import evaluate
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.learning import Beside, InTurn, Learning
from thinknav_trainer.obstacle_memory import ObstacleMemory
from thinknav_trainer.planner import PlannerClient
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.progress import progress_bar
from thinknav_trainer.recording import AskRecorded, Recording
from thinknav_trainer.reference import Reference
from thinknav_trainer.run import Run, checkpoint_path
from thinknav_trainer.run_elsewhere import RunElsewhere
from thinknav_trainer.scenes import Homes
from thinknav_trainer.summary import share_of, summarize
from thinknav_trainer.think_price import ThinkPrice
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.thought_scale import centre_and_scale, typical_sentences
from thinknav_trainer.timing import Stopwatch
from thinknav_trainer.vision import EmbeddingSpaceError
from thinknav_trainer.warm_start import Cloner, Demonstrations
from thinknav_trainer.workers import Lone, Workers, any_of, seed_of

logger = logging.getLogger(__name__)

VALIDATED = ("success", "spl", "soft_spl", "distance_to_goal", "think_rate")
SHORT_EPISODE_STEPS = 10  # a policy whose episodes are shorter has learnt to stop at once, and nothing else


@dataclass
class Session:
    """What a run is made of while it runs.

    steps: of all workers. best: the highest SPL on validation episodes so far. validated: after how many steps they
    were played last.
    """

    env: ThinkingEnv
    learner: PPO
    learning: Learning
    actor: Actor
    collector: Collector
    price: ThinkPrice
    planner: PlannerClient | None
    workers: Workers = field(default_factory=Lone)
    steps: int = 0
    best: float = -math.inf
    validated: int = -1
    warned_of_short_episodes: bool = False


def train(
    run: Run | RunElsewhere,
    homes: Homes,
    planner: PlannerClient | None,
    interruption: Interruption,
    resume_from: Checkpoint | None = None,
    recording: Recording | None = None,
    workers: Workers = Lone(),
) -> Path:
    """Collect, learn, log, save, until the step budget is spent or the user interrupts; the last checkpoint's path.

    With a warm start, imitate first.
    recording: replies come from it, in its order, and `planner` is the one that it recorded; validation episodes are
    not played then, for nobody could answer. workers: those that train
    this policy; each calls `train`, and the first writes it down.
    Raises TrainingDiverged, Unavailable when the planner has been gone too long, and WorkerLost.
    """
    config = run.config
    if recording is not None:
        homes = replace(homes, validation=[])
    session = open_session(config, homes, planner, resume_from, recording, workers)
    log_planner(run, session)
    started = time.monotonic()
    if resume_from is None:
        run.checkpoint(snapshot(session, config))
    if session.steps < config.warm_start.steps:
        begun = checkpoint_path(run.folder, session.steps)
        if not imitate(session, run, interruption):
            logger.info("stopped in its warm start, which begins anew when the run goes on")
            return begun
        validate(session, run, homes, interruption)
        run.checkpoint(snapshot(session, config))
    due = session.steps + config.checkpoint_every
    with progress_bar("training", config.total_steps, session.steps) as bar:
        while session.steps < config.total_steps and not any_of(workers, interruption.requested):
            learnt, transitions = improve(session, run)
            metrics = log_update(session, run, learnt, transitions)
            bar.update(session.steps, f"success {metrics.get('success', 0):.2f}")
            if session.steps >= due:
                settle(session, run)
                validate(session, run, homes, interruption)
                run.checkpoint(snapshot(session, config))
                due = session.steps + config.checkpoint_every
            minutes = (time.monotonic() - started) / 60
            if config.max_minutes is not None and any_of(workers, minutes >= config.max_minutes):
                logger.info("max_minutes is over after %d steps", session.steps)
                break
    settle(session, run)
    validate(session, run, homes, interruption)
    return run.checkpoint(snapshot(session, config))


def remaining(session: Session, config: TrainConfig) -> float:
    """Share of the run that is left."""
    return 1 - session.steps / config.total_steps


def improve(session: Session, run: Run | RunElsewhere) -> tuple[dict[str, float], int]:
    """Collect once and learn once: what to log of that, and this worker's number of transitions.

    Raises TrainingDiverged.
    """
    session.env.share = session.steps / run.config.total_steps
    session.env.price = session.price.now
    with dumped(session, run):
        rollout, losses = session.learning.improve(session.collector.collect, remaining(session, run.config))
    return named_losses(losses) | session.price.update(rollout, session.env.share), len(rollout)


def settle(session: Session, run: Run | RunElsewhere) -> None:
    """Learn what is still to be learnt of what was collected. Raises TrainingDiverged."""
    with dumped(session, run):
        session.learning.settle()


@contextmanager
def dumped(session: Session, run: Run | RunElsewhere) -> Iterator[None]:
    """What is not finite leaves a dump, and becomes TrainingDiverged, which names it."""
    try:
        yield
    except NotFinite as error:
        config = run.config.model_dump(mode="json")
        path = run.dump(session.steps, {"what": str(error), "config": config, **error.evidence})
        raise TrainingDiverged(
            f"not finite after {session.steps} steps: {error}; to see it again: thinknav redo {path}"
        ) from error


def named_losses(losses: dict[str, float]) -> dict[str, float]:
    """As the log names them."""
    return {f"losses/{name}": value for name, value in losses.items()}


def imitate(session: Session, run: Run | RunElsewhere, interruption: Interruption) -> bool:
    """The warm start: demonstrations and cloning in turn, then new episodes for PPO; whether it came to its end.

    There are no checkpoints within: they would have to hold all that was shown. Raises TrainingDiverged.
    """
    config = run.config
    workers = session.workers
    seed = seed_of(config.seed, workers.rank)
    demonstrator = DEMONSTRATORS[config.warm_start.demonstrator](session.env, seed)
    shown = Demonstrations(session.env, session.actor, demonstrator, session.collector, config.ppo)
    cloner = Cloner(session.learner.policy, config.warm_start, config.ppo, seed, workers)
    with progress_bar("imitating", config.warm_start.steps, session.steps) as bar:
        wanted = min(config.warm_start.steps, config.total_steps)
        while session.steps < wanted and not any_of(workers, interruption.requested):
            with dumped(session, run):
                rollout = shown.collect(own=config.warm_start.own_share * session.steps / wanted)
                with session.collector.stopwatch("learn"):
                    losses = cloner.update(rollout)
            session.learning.follow()
            log_update(session, run, named_losses(losses), len(rollout))
            bar.update(session.steps, f"accuracy {losses['cloning_accuracy']:.2f}")
    session.collector.restart(session.learner.policy)
    return session.steps >= wanted


def log_update(
    session: Session, run: Run | RunElsewhere, learnt: dict[str, float], transitions: int
) -> dict[str, float]:
    """Count the steps of an update, in all, and write everything down about it; the metrics."""
    shares = session.workers.gather(share_of(session.collector, session.env, transitions))
    together = sum(share.transitions for share in shares)
    session.steps += together
    metrics = summarize(shares) | learnt
    _warn_of_short_episodes(session, metrics, sum(share.recent for share in shares))
    seconds = session.collector.stopwatch.take()
    timing = {f"time/{name}": value for name, value in seconds.items()}
    run.log(session.steps, metrics, timing | {"steps_per_s": together / sum(seconds.values())})
    run.log_thoughts(session.steps, session.collector.thoughts)
    run.log_texts(session.steps, session.env.texts)
    return metrics


def validate(session: Session, run: Run | RunElsewhere, homes: Homes, interruption: Interruption) -> None:
    """Play the validation episodes, if there are any, and keep the checkpoint if it is the best so far.

    Workers deal them out among themselves. Who is told to end is not held up by them.
    """
    if not homes.validation or session.validated == session.steps or any_of(session.workers, interruption.requested):
        return
    config, policy, workers = run.config, session.learner.policy, session.workers
    dealt = homes.validation[workers.rank :: workers.count]
    records = evaluate(policy, config, homes.scenes, dealt, session.planner, interruption) if dealt else []
    if any_of(workers, interruption.requested):
        return
    played = list(chain(*workers.gather([record.measures for record in records])))
    measures = {name: float(np.mean([measure[name] for measure in played])) for name in VALIDATED}
    run.log_validation(session.steps, measures)
    session.validated = session.steps
    if measures["spl"] > session.best:
        session.best = measures["spl"]
        run.keep_best(snapshot(session, config))


def log_planner(run: Run | RunElsewhere, session: Session) -> None:
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
    workers: Workers = Lone(),
) -> Session:
    """Build env, policy, learner and collector, and put them where a checkpoint left them. Raises CheckpointError,
    EmbeddingSpaceError, RendererUnavailable, or ConfigError for a GPU that is not there.
    """
    if threads := config.threads or workers.threads:
        torch.set_num_threads(threads)
        set_render_threads(threads)
    require_shared_space(config, planner)
    if resume_from is not None:
        resume_from.require(action_space(config), embedding_space(planner))
    seed = seed_of(config.seed, workers.rank, 0 if resume_from is None else resume_from.steps)
    device = find_device(config.device)
    renderer = WarpRenderer(str(device)) if config.renderer == "warp" else make_renderer(config.renderer)
    vector_env = ObjectNavVectorEnv(
        homes.scenes, homes.train, config.num_envs, config.task, seed=seed, order="random", renderer=renderer
    )
    control = config.planner.control
    if recording is not None and control not in REPLIES_KEPT:  # recorded replies were replaced already
        control = "none"
    memory = ObstacleMemory(config.num_envs, config.task) if config.policy.obstacle_memory else None
    asking, discount = _asking(config, recording), config.ppo.gamma
    env = ThinkingEnv(vector_env, config.think, planner, asking, discount, seed, control, memory)
    torch.manual_seed(config.seed)
    policy = Policy(observation_shape(config, planner), config.network)
    if planner is not None and resume_from is None:
        centre, scale = centre_and_scale(env.embed(typical_sentences()))
        policy.scale_thoughts(torch.from_numpy(centre), scale)
    if workers.count > 1:
        agree(workers, policy, planner)
    policy.to(device)
    learner, stopwatch = PPO(policy, config.ppo, seed, workers), Stopwatch()
    beside = config.learn_beside and not config.deterministic and workers.count == 1
    learning = (Beside if beside else InTurn)(learner, stopwatch)
    actor = Actor(learning.acting, config.num_envs, config.ppo.precision, seed)
    reference = Reference(policy, config.num_envs, config.ppo.precision) if config.ppo.kl_coef else None
    collector = Collector(env, actor, config.ppo, workers, stopwatch, reference)
    session = Session(env, learner, learning, actor, collector, ThinkPrice(config.think, workers), planner, workers)
    if resume_from is not None:
        restore(session, resume_from)
    return session


def agree(workers: Workers, policy: Policy, planner: PlannerClient | None) -> None:
    """Give all workers the first one's weights: on another machine the same seed may have made others.

    Raises EmbeddingSpaceError where they read thoughts of several spaces.
    """
    spaces = sorted(set(map(str, workers.gather(embedding_space(planner)))))
    if len(spaces) > 1:
        raise EmbeddingSpaceError(f"the workers' planners are of several embedding spaces: {', '.join(spaces)}")
    policy.load_state_dict(workers.share(policy.state_dict))


def restore(session: Session, checkpoint: Checkpoint) -> None:
    """Put a session where a checkpoint left it.

    A worker that the checkpoint does not know begins new episodes; the first counts as its own what those had counted
    who are no more.
    """
    state, workers = checkpoint.state, session.workers
    known = [{"collector": state["collector"], "order": state["learner"]["order"]}, *state.get("others", [])]
    session.learner.policy.load_state_dict(checkpoint.policy)
    session.learning.follow()
    if workers.rank < len(known):
        session.learner.load_state_dict(state["learner"] | {"order": known[workers.rank]["order"]})
        session.collector.load_state_dict(known[workers.rank]["collector"])
    else:
        session.learner.load_state_dict(state["learner"] | {"order": session.learner.state_dict()["order"]})
        session.collector.adopt_reference(state["collector"])
    if workers.rank == 0:
        for gone in known[workers.count :]:
            session.collector.adopt_counts(gone["collector"])
    session.steps = checkpoint.steps
    session.best = state["best"]
    session.validated = state.get("validated", -1)  # older checkpoints do not say
    session.price.load_state_dict(state.get("price", session.price.state_dict()))  # older checkpoints have none


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
    if planner is None or not config.policy.image_encoder.startswith("clip"):
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
    """All of a run at this moment, in the first worker's hands. All workers call it."""
    learner, collector = session.learner.state_dict(), session.collector.state_dict()
    states = session.workers.bring({"collector": collector, "order": learner["order"]})
    return Checkpoint(
        config=config.model_dump(mode="json"),
        action_space=action_space(config),
        embedding_space=embedding_space(session.planner),
        thought_size=session.learner.policy.shape.thought_size,
        steps=session.steps,
        policy=session.learner.policy.state_dict(),
        state={
            "learner": learner,
            "collector": collector,
            "others": states[1:],
            "best": session.best,
            "validated": session.validated,
            "price": session.price.state_dict(),
        },
    )


def _warn_of_short_episodes(session: Session, metrics: dict[str, float], recent: int) -> None:
    """Once a run: a policy that stops at once earns nothing, and may never learn otherwise."""
    steps = metrics.get("episode_steps", math.inf)
    full = recent == RECENT_EPISODES * session.workers.count
    if full and steps < SHORT_EPISODE_STEPS and not session.warned_of_short_episodes:
        session.warned_of_short_episodes = True
        logger.warning(
            "the last %d episodes lasted %.0f steps: the policy stops at once; if that goes on, see policy.stop_bias",
            recent,
            steps,
        )
