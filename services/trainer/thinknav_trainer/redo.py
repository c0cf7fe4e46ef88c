"""Goes once more through what made a run stop: see `dumps`."""

from pathlib import Path
from typing import Any

import numpy as np

from thinknav_trainer.config import parse_config
from thinknav_trainer.dumps import NotFinite, read_dump
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.precision import autocast
from thinknav_trainer.rollout import Rollout


def redo_dump(path: Path) -> str:
    """What happens, in words. Raises CheckpointError for a file that is no dump."""
    evidence = read_dump(path)
    if "rollout" in evidence:
        again = _update(evidence)
    elif "observations" in evidence:
        again = _observation(evidence)
    else:
        again = "this is not gone through again: train once more with the configuration and seed that the dump holds"
    return f"the run stopped at: {evidence['what']}\nonce more: {again}"


def _update(evidence: dict[str, Any]) -> str:
    config = parse_config(evidence["config"])
    policy = Policy(ObservationShape(**evidence["shape"]), config.network)
    policy.load_state_dict(evidence["policy"])
    learner = PPO(policy, config.ppo)
    learner.load_state_dict(evidence["learner"])
    rollout = Rollout(**evidence["rollout"])
    with autocast(config.ppo.precision):
        observations = policy.vision.prepare(rollout.observations)
    try:
        losses = learner.minibatch(rollout, observations, evidence["advantages"], evidence["chosen"])
    except NotFinite as error:
        return str(error)
    return f"the same minibatch is finite here: {losses}"


def _observation(evidence: dict[str, Any]) -> str:
    lines = []
    for name, values in {**evidence["observations"], "reward": evidence["rewards"]}.items():
        for row, env in enumerate(evidence["envs"]):
            wrong = 0 if values.dtype.kind != "f" else int(np.count_nonzero(~np.isfinite(values[row])))
            if wrong:
                pose = evidence["env"]["env"]["agents"]["poses"][env]
                lines.append(f"{name} of env {env}: {wrong} of {values[row].size} numbers, at pose {pose.tolist()}")
    return "; ".join(lines)
