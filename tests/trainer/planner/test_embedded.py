"""The embedded planner in our own process: it says what the planning service's says, for all who think at once."""

from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from thinknav_models.clip import shipped_text_encoder
from thinknav_models.subgoal_vlm import SubgoalVLM
from thinknav_proto import Frame, InvalidRequest, SubgoalReply, SubgoalRequest
from thinknav_server.planners import PlanItem, View
from thinknav_server.planners.embedded import EmbeddedPlanner as ServedPlanner
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import encode_frame
from thinknav_trainer.planner.embedded import EmbeddedPlanner
from thinknav_trainer.run import read_log
from thinknav_trainer.scenes import Homes
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.workflow import evaluate_checkpoint, train_run

GOALS = ("chair", "bed", "toilet", "tv_monitor")


def frames(homes: Homes, smoke: TrainConfig) -> list[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]:
    env = ObjectNavVectorEnv(homes.scenes, homes.train, 8, smoke.task, seed=1)
    env.reset()
    drawn = list(env.frames(np.arange(8), 128, 128))
    env.close()
    return drawn


def test_it_says_what_the_service_says(homes: Homes, smoke: TrainConfig) -> None:
    seen = frames(homes, smoke)
    asked = [(frame, GOALS[n % 4], "plan" if n == 5 else "subgoal", n % 2) for n, frame in enumerate(seen)]
    served = ServedPlanner()
    expected = served.plan(
        [PlanItem(frame, goal, mode, (View(seen[0], 0.7),) * views) for frame, goal, mode, views in asked]  # type: ignore[arg-type]
    )
    requests = [
        SubgoalRequest(
            request_id=str(number),
            goal=goal,
            frame=Frame.raw(frame),
            mode=mode,  # type: ignore[arg-type]
            recent=(Frame.raw(seen[0], 0.7),) * views,
        )
        for number, (frame, goal, mode, views) in enumerate(asked)
    ]
    with EmbeddedPlanner() as planner:
        assert planner.info.identity == f"embedded@{served.identity.revision}"
        assert planner.info.embedding_space == str(shipped_text_encoder().space)
        with patch.object(SubgoalVLM, "answer", autospec=True, side_effect=SubgoalVLM.answer) as forward:
            replies = planner.ask(requests)
        assert forward.call_count == 1
    assert len({plan.instructions for plan in expected}) > 2
    for (_, _, mode, _), plan, reply in zip(asked, expected, replies, strict=True):
        assert isinstance(reply, SubgoalReply)
        assert (reply.subgoal, reply.confidence) == (plan.instructions[0], plan.confidence)
        assert reply.instructions == (plan.instructions if mode == "plan" else ())
        assert reply.embedding == pytest.approx(shipped_text_encoder().encode([reply.subgoal])[0], abs=1e-6)


def test_what_is_drawn_follows_from_the_request_and_a_bad_frame_fails_alone(homes: Homes, smoke: TrainConfig) -> None:
    seen = frames(homes, smoke)

    def asked(first: int) -> list[SubgoalRequest]:
        return [
            SubgoalRequest(request_id=str(first + n), goal="chair", frame=encode_frame(frame), temperature=3.0)
            for n, frame in enumerate(seen)
        ]

    def subgoals(planner: EmbeddedPlanner, first: int) -> list[str]:
        return [reply.subgoal for reply in planner.ask(asked(first)) if isinstance(reply, SubgoalReply)]

    with EmbeddedPlanner(seed=1) as planner, EmbeddedPlanner(seed=2) as other:
        once = subgoals(planner, 1)
        assert subgoals(planner, 9) != once
        assert subgoals(planner, 1) == once != subgoals(other, 1)
        broken = asked(1)[0].model_copy(update={"frame": Frame(encoding="jpeg", data=b"no image")})
        first, second = planner.ask([broken, asked(1)[1]])
        assert isinstance(first, InvalidRequest)
        assert isinstance(second, SubgoalReply)
        [alone] = planner.ask([broken])
        assert isinstance(alone, InvalidRequest)


def test_what_is_not_drawn_is_worked_out_once() -> None:
    seen = np.random.default_rng(0).integers(0, 256, (4, 128, 128, 3), dtype=np.uint8)

    def request(number: int, **changes: object) -> SubgoalRequest:
        base = SubgoalRequest(request_id="1", goal="chair", frame=Frame.raw(seen[number]))
        return base.model_copy(update=changes)

    def worked_out(planner: EmbeddedPlanner, *requests: SubgoalRequest) -> int:
        with patch.object(SubgoalVLM, "answer", autospec=True, side_effect=SubgoalVLM.answer) as forward:
            replies = planner.ask(requests)
        said.append([reply.subgoal for reply in replies if isinstance(reply, SubgoalReply)])
        assert len(said[-1]) == len(requests)
        return sum(len(call.args[1]) for call in forward.call_args_list)

    said: list[list[str]] = []
    with EmbeddedPlanner() as planner, patch("thinknav_trainer.planner.embedded._REMEMBERED", 4):
        assert worked_out(planner, request(0), request(1), request(2)) == 3
        assert worked_out(planner, request(2), request(3), request(0)) == 1
        assert [said[1][0], said[1][2]] == [said[0][2], said[0][0]]
        earlier = (Frame.raw(seen[3], 0.5),)
        others: list[dict[str, object]] = [
            {"goal": "bed"},
            {"mode": "plan"},
            {"recent": earlier},
            {"recent": (Frame.raw(seen[3], 0.6),)},
        ]
        assert worked_out(planner, *(request(0, **changes) for changes in others)) == 4
        assert worked_out(planner, request(0)) == 1  # forgotten
        for _ in range(2):
            assert worked_out(planner, request(0, temperature=0.5)) == 1


def test_a_run_with_it_needs_no_service_and_is_the_same_every_time(
    tmp_path: Path, smoke: TrainConfig, homes: Homes
) -> None:
    """Not in lock-step: it answers at once all the same, and sees pixels as they are."""
    changes = ["planner=embedded", "deterministic=false", "think.temperature=1", "think.context=3", "total_steps=128"]
    config = change_config(smoke, overrides=changes)
    shown: list[str] = []
    ask = ThinkingEnv._requests

    def note(env: ThinkingEnv, *arguments: object) -> list[SubgoalRequest]:
        requests: list[SubgoalRequest] = ask(env, *arguments)  # type: ignore[arg-type]
        shown.extend(frame.encoding for request in requests for frame in request.frames)
        return requests

    with patch.object(ThinkingEnv, "_requests", note):
        for name in ("one", "two"):
            last = train_run(tmp_path / name, config, Interruption(), homes=homes)
    assert set(shown) == {"raw"}
    for log in ("metrics.jsonl", "thoughts.jsonl"):
        assert (tmp_path / "one" / log).read_text() == (tmp_path / "two" / log).read_text()
    assert read_log(tmp_path / "one" / "metrics.jsonl")[-1]["thoughts/failed"] == 0
    folder, records = evaluate_checkpoint(last, "held_out", Interruption(), homes=homes)
    assert '"planner": "embedded@' in (folder / "result.json").read_text()
    assert any(record.thoughts for record in records)
