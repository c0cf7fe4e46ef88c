"""What the commands do, in order: read, connect, prepare, run, write. Shared by `train`, `eval` and `demo`."""

import logging
import os
import re
from contextlib import ExitStack
from pathlib import Path

from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import ConfigError, TrainConfig, parse_config
from thinknav_trainer.device import find_device_or_cpu
from thinknav_trainer.episode_sets import EpisodeSet
from thinknav_trainer.evaluate import Clock, EpisodeRecord, evaluate, write_evaluation
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import PlannerClient, PlannerError, connect, read_token
from thinknav_trainer.planner.embedded import EmbeddedPlanner
from thinknav_trainer.planner.privileged import PrivilegedPlanner
from thinknav_trainer.policy import Policy
from thinknav_trainer.recording import Recording
from thinknav_trainer.run import Run, RunError, checkpoint_path, list_checkpoints, newest_checkpoint, read_config
from thinknav_trainer.run_elsewhere import RunElsewhere
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.train import action_space, embedding_space, observation_shape, require_shared_space, train
from thinknav_trainer.when_to_think import WhenToThink
from thinknav_trainer.workers import Lone, Workers

logger = logging.getLogger(__name__)

SPLITS = ("held_out", "train")

# What a run cannot change when it goes on: its envs, and with them the state that it goes on from.
FIXED = ("seed", "num_envs", "scenes", "env", "policy")


def connect_if_thinking(config: TrainConfig, stack: ExitStack) -> PlannerClient | None:
    """The planner that a configuration needs, closed with the stack; None for a policy that never thinks.

    Raises ConfigError when it cannot be used: which planner there is, is the user's to say; EmbeddingSpaceError when
    the policy cannot read its thoughts.
    """
    if config.think.strategy == "never":
        return None
    where = config.planner
    if where.knows_the_map:
        if config.think.strategy == "once":
            raise ConfigError("planner.url privileged makes no plans: it does not go with think.strategy once")
        return stack.enter_context(PrivilegedPlanner(where.privileged, config.seed))
    if where.is_embedded:
        return stack.enter_context(EmbeddedPlanner(config.seed))
    try:
        token = read_token(where.token_file)
        planner = stack.enter_context(connect(where.url, token=token, tls_ca=where.tls_ca))
    except (PlannerError, ValueError) as error:
        raise ConfigError(str(error)) from None
    require_shared_space(config, planner)
    return planner


def train_run(
    folder: Path,
    config: TrainConfig,
    interrupted: Interruption,
    resume: bool = False,
    homes: Homes | None = None,
    replay: Path | None = None,
    workers: Workers = Lone(),
) -> Path:
    """Begin a run or go on with it; the path of its last checkpoint.

    replay: the folder of a run whose recorded replies take the place of a planner. workers: who trains together; only
    the first needs the folder.
    """
    if replay is not None and workers.count > 1:
        raise ConfigError("--replay is for a run of one process")
    recording = None if replay is None or config.think.strategy == "never" else Recording(replay)
    start = workers.share(lambda: _start(folder, config, resume))
    if start is not None and start.steps >= config.total_steps:
        logger.info("%s has done %d steps, as many as are wanted: there is nothing left to train", folder, start.steps)
        return checkpoint_path(folder, start.steps)
    with ExitStack() as stack:
        planner = connect_if_thinking(config, stack) if recording is None else recording.planner()
        if start is not None:
            start.require(action_space(config), embedding_space(planner))
        homes = homes or make_homes(config)
        logger.info("%d training and %d held-out episodes", len(homes.train), len(homes.held_out))
        run = _open_run(folder, config, resume, start, workers)
        stack.callback(run.close)
        return train(run, homes, planner, interrupted, start, recording, workers=workers)


def _start(folder: Path, config: TrainConfig, resume: bool) -> Checkpoint | None:
    """Where a run goes on from. Raises RunError or ConfigError where the folder is not for it."""
    if resume:
        # Killed before its first checkpoint, a run has nothing to go on from, and begins again.
        start = newest_checkpoint(folder) if list_checkpoints(folder) else None
        _check_unchanged(read_config(folder), config, 0 if start is None else start.steps)
        return start
    if (folder / "config.yaml").exists():
        raise RunError(f"{folder} holds a run already; go on with --resume, or give another --name")
    return None


def _open_run(
    folder: Path, config: TrainConfig, resume: bool, start: Checkpoint | None, workers: Workers
) -> Run | RunElsewhere:
    if workers.rank > 0:
        return RunElsewhere(folder, config, workers.rank)
    return Run(folder, config, 0 if start is None else start.steps) if resume else Run.create(folder, config)


def _check_unchanged(before: TrainConfig, now: TrainConfig, steps: int) -> None:
    """Refuse what does not fit the state that a run goes on from, after so many steps. Raises ConfigError."""
    changed = [name for name in FIXED if getattr(before, name) != getattr(now, name)]
    taught = steps > 0 and steps >= before.warm_start.steps
    for name, differs in (
        ("think.strategy", before.think.strategy != now.think.strategy),
        ("think.forced from nothing or to nothing", bool(before.think.forced) != bool(now.think.forced)),
        ("ppo.kl_coef from nothing", taught and bool(now.ppo.kl_coef) and not before.ppo.kl_coef),
        ("warm_start.steps", taught and now.warm_start.steps > steps),
    ):
        changed += [name] * differs
    if changed:
        raise ConfigError(f"a run that goes on cannot change {', '.join(changed)}; start another one for that")


def evaluate_checkpoint(
    path: Path,
    split: str,
    interrupted: Interruption,
    planner_url: str | None = None,
    greedy: bool = False,
    output: Path | None = None,
    homes: Homes | None = None,
    elsewhere: EpisodeSet | None = None,
    clock: Clock = Clock(),
    when: WhenToThink = WhenToThink(),
    control: str | None = None,
) -> tuple[Path, list[EpisodeRecord]]:
    """Play a split, or episodes `elsewhere`, with a checkpoint's policy: the folder of the result, and the records.

    when: it thinks, if otherwise than it learnt to; such results lie in `budgets/` of the run by default.
    control: what the policy is told in the place of replies, if otherwise than in its training; in `controls/`.
    When the user interrupts, nothing is written: part of a split is biased towards short episodes.
    """
    if elsewhere is None:
        require_split(split)
    checkpoint = Checkpoint.load(path)
    config = when.configure(parse_config(checkpoint.config).with_planner(planner_url).with_control(control))
    if control is not None and config.think.strategy == "never":
        raise ConfigError("a control replaces replies, and the policy of this checkpoint never thinks")
    where = split if elsewhere is None else elsewhere.name
    folder = output or _usual_folder(path, f"{where}-greedy" if greedy else where, when, control)
    with ExitStack() as stack:
        planner = connect_if_thinking(config, stack)
        checkpoint.require(action_space(config), embedding_space(planner))
        policy = Policy(observation_shape(config, planner), config.policy)
        policy.load_state_dict(checkpoint.policy)
        when.apply(policy)
        policy.to(find_device_or_cpu(config.device))
        played = elsewhere or own_split(config, split, homes)
        records = evaluate(policy, config, played.scenes, played.episodes, planner, interrupted, greedy, clock)
        protocol = {
            "checkpoint_steps": checkpoint.steps,
            "split": where,
            "clock": vars(clock),
            "episodes": len(records),
            "actions": "greedy" if greedy else "sampled",
            "thinking": vars(when),
            "planner": None if planner is None else planner.info.identity,
            "control": config.planner.control,
            "privileged": isinstance(planner, PrivilegedPlanner),
            "config": config.model_dump(mode="json"),
        }
        if not interrupted.requested:
            write_evaluation(folder, protocol, records)
    return folder, records


def _usual_folder(checkpoint: Path, where: str, when: WhenToThink, control: str | None) -> Path:
    """Where an evaluation goes by default: what was played otherwise than it was learnt lies apart."""
    if control is not None:
        folder = evaluation_folder(checkpoint, where, "controls") / control
        return folder if when.as_learnt else folder / when.name
    return (
        evaluation_folder(checkpoint, where)
        if when.as_learnt
        else evaluation_folder(checkpoint, where, "budgets") / when.name
    )


def evaluation_folder(checkpoint: Path, where: str, kind: str = "evaluations") -> Path:
    """Where in its run a checkpoint's evaluation lies. where: the episodes' name."""
    run = Path(os.path.normpath(checkpoint.parent / ".."))  # also from within the folder of checkpoints
    return run / kind / folder_name(f"{checkpoint.stem}-{where}")


def folder_name(name: str) -> str:
    """A name without what folders' names had better not have."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name)


def own_split(config: TrainConfig, split: str, homes: Homes | None = None) -> EpisodeSet:
    """The episodes of a split of a run. homes: of the run, where they are at hand. Raises ConfigError."""
    require_split(split)
    homes = homes or make_homes(config)
    return EpisodeSet(split, homes.scenes, homes.held_out if split == "held_out" else homes.train)


def require_split(split: str) -> None:
    """Raises ConfigError for the name of none."""
    if split not in SPLITS:
        raise ConfigError(f"there is no split {split!r}; there are {' and '.join(SPLITS)}")
