"""What the commands do, in order: read, connect, prepare, run, write. Shared by `train`, `eval` and `demo`."""

import logging
from contextlib import ExitStack
from pathlib import Path

from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import ConfigError, TrainConfig, parse_config
from thinknav_trainer.evaluate import EpisodeRecord, evaluate, write_evaluation
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import PlannerClient, PlannerError, connect, read_token
from thinknav_trainer.policy import Policy
from thinknav_trainer.run import Run, RunError, newest_checkpoint, read_config
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.train import action_space, embedding_space, observation_shape, train

logger = logging.getLogger(__name__)

SPLITS = ("held_out", "train")

# What a run cannot change when it goes on: its envs, and with them the state that it goes on from.
FIXED = ("seed", "num_envs", "scenes", "env", "policy")


def connect_if_thinking(config: TrainConfig, stack: ExitStack) -> PlannerClient | None:
    """The planner that a configuration needs, closed with the stack; None for a policy that never thinks.

    Raises ConfigError when it cannot be used: which planner there is, is the user's to say.
    """
    if config.think.strategy == "never":
        return None
    where = config.planner
    try:
        token = read_token(where.token_file)
        return stack.enter_context(connect(where.url, token=token, tls_ca=where.tls_ca))
    except (PlannerError, ValueError) as error:
        raise ConfigError(str(error)) from None


def train_run(
    folder: Path,
    config: TrainConfig,
    interrupted: Interruption,
    resume: bool = False,
    homes: Homes | None = None,
) -> Path:
    """Begin a run or go on with it; the path of its last checkpoint."""
    start = None
    if resume:
        start = newest_checkpoint(folder)
        _check_unchanged(read_config(folder), config)
    elif (folder / "config.yaml").exists():
        raise RunError(f"{folder} holds a run already; go on with --resume, or give another --name")
    with ExitStack() as stack:
        planner = connect_if_thinking(config, stack)
        if start is not None:
            start.require(action_space(config), embedding_space(planner))
        homes = homes or make_homes(config)
        logger.info("%d training and %d held-out episodes", len(homes.train), len(homes.held_out))
        run = Run.create(folder, config) if start is None else Run(folder, config, start.steps)
        stack.callback(run.close)
        return train(run, homes, planner, interrupted, start)


def _check_unchanged(before: TrainConfig, now: TrainConfig) -> None:
    changed = [name for name in FIXED if getattr(before, name) != getattr(now, name)]
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
) -> tuple[Path, list[EpisodeRecord]]:
    """Play a split with a checkpoint's policy: the folder of the result, and the records.

    When the user interrupts, nothing is written: part of a split is biased towards short episodes.
    """
    if split not in SPLITS:
        raise ConfigError(f"there is no split {split!r}; there are {' and '.join(SPLITS)}")
    checkpoint = Checkpoint.load(path)
    config = parse_config(checkpoint.config).with_planner(planner_url)
    folder = output or path.parent.parent / "evaluations" / f"{path.stem}-{split}"
    with ExitStack() as stack:
        planner = connect_if_thinking(config, stack)
        checkpoint.require(action_space(config), embedding_space(planner))
        homes = homes or make_homes(config)
        policy = Policy(observation_shape(config, planner), config.policy)
        policy.load_state_dict(checkpoint.policy)
        episodes = homes.held_out if split == "held_out" else homes.train
        records = evaluate(policy, config, homes.scenes, episodes, planner, interrupted, greedy)
        protocol = {
            "checkpoint_steps": checkpoint.steps,
            "split": split,
            "episodes": len(records),
            "actions": "greedy" if greedy else "sampled",
            "planner": None if planner is None else planner.info.identity,
            "config": config.model_dump(mode="json"),
        }
        if not interrupted.requested:
            write_evaluation(folder, protocol, records)
    return folder, records
