"""A run made again from its recorded replies equals the recorded one, though that did not wait for anybody."""

import json
import random
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from thinknav_proto import PlannerFailed, SubgoalReply, SubgoalRequest
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import MockTransport, PlannerClient, reply_to
from thinknav_trainer.recording import Recording, RecordingError
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import train

SUBGOALS = ("turn left to the door", "turn right", "move forward", "look around")


def whimsical(request: SubgoalRequest) -> SubgoalReply:
    """Answers when and what it likes: no two runs are the same."""
    time.sleep(random.random() * 0.02)
    if random.random() < 0.2:
        raise PlannerFailed("not in the mood")
    said = random.choice(SUBGOALS)
    plan = (said, "stop") if request.mode == "plan" else ()
    return reply_to(request, said).model_copy(update={"instructions": plan})


def trained(folder: Path, config: TrainConfig, homes: Homes, replay: Path | None = None) -> Checkpoint:
    recording = None if replay is None else Recording(replay)
    planner = PlannerClient(MockTransport(whimsical)) if recording is None else recording.planner()
    with closing(Run.create(folder, config)) as run:
        return Checkpoint.load(train(run, homes, planner, Interruption(), recording=recording))


@pytest.mark.parametrize(
    ("strategy", "more"),
    [
        ("agent", "learn_beside=false"),
        ("once", "learn_beside=false"),
        ("agent", "learn_beside=true"),
        ("agent", "warm_start.steps=128"),
    ],
)
def test_a_replay_equals_what_was_recorded(
    tmp_path: Path, smoke: TrainConfig, homes: Homes, strategy: str, more: str
) -> None:
    overrides = [
        "deterministic=false",
        more,
        "policy.stop_bias=-1",
        f"think.strategy={strategy}",
        "think.reward=paper",
    ]
    overrides += ["think.dropout=0.3"] if strategy == "agent" else []
    config = change_config(smoke, overrides=[*overrides, "policy.think_bias=1", "ppo.precision=float32"])
    recorded = trained(tmp_path / "recorded", config, homes)
    again = trained(tmp_path / "again", config, homes, replay=tmp_path / "recorded")
    for name, weight in recorded.policy.items():
        assert torch.equal(weight, again.policy[name]), name
    for log in ("metrics", "thoughts", "embeddings"):
        texts = {(tmp_path / run / f"{log}.jsonl").read_text() for run in ("recorded", "again")}
        assert len(texts) == 1, log
    lines = [json.loads(line) for line in (tmp_path / "recorded/thoughts.jsonl").read_text().splitlines()]
    assert len({line["subgoal"] for line in lines}) > 2
    assert any(line["subgoal"] is None for line in lines)


def test_a_replay_of_a_warm_start_hears_how_sure_the_planner_was(
    tmp_path: Path, smoke: TrainConfig, homes: Homes
) -> None:
    def unsure(request: SubgoalRequest) -> SubgoalReply:
        said = random.choice((*SUBGOALS, "stop", "stop"))
        return reply_to(request, said).model_copy(update={"confidence": random.random()})

    overrides = ["deterministic=true", "warm_start.steps=192", "ppo.precision=float32", "checkpoint_every=32"]
    config = change_config(smoke, overrides=overrides)
    split = replace(homes, train=homes.train[:-3], validation=homes.train[-3:])
    with closing(Run.create(tmp_path / "recorded", config)) as run:
        train(run, split, PlannerClient(MockTransport(unsure)), Interruption())
    trained(tmp_path / "again", config, split, replay=tmp_path / "recorded")
    texts = {(tmp_path / run / "metrics.jsonl").read_text() for run in ("recorded", "again")}
    assert len(texts) == 1


def test_a_replay_of_something_else_says_so(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    with pytest.raises(RecordingError, match=r"absent cannot be replayed: cannot read .*planner\.json"):
        Recording(tmp_path / "absent")
    config = change_config(smoke, overrides=["policy.think_bias=1", "total_steps=64"])
    trained(tmp_path / "recorded", config, homes)
    other = change_config(config, overrides=["seed=5"])
    with pytest.raises(RecordingError, match="has left its recording"):
        trained(tmp_path / "again", other, homes, replay=tmp_path / "recorded")
