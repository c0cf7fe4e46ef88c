"""The planner that knows the map: right as often as it says, repeatable, and named wherever it was asked."""

import json
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from tests.trainer.obeying import ThinkAndObey
from thinknav_proto import PlannerFailed, SubgoalReply, SubgoalRequest
from thinknav_sim.follower import ShortestPathFollower
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.config import ConfigError, PrivilegedConfig, TrainConfig, change_config
from thinknav_trainer.direction import subgoal_direction
from thinknav_trainer.evaluate import Conditions, EpisodeRecord, play
from thinknav_trainer.evaluate_agent import Setting, evaluate_agent
from thinknav_trainer.home_sets import HomeSet
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import encode_frame
from thinknav_trainer.planner.privileged import PrivilegedPlanner
from thinknav_trainer.scenes import Homes
from thinknav_trainer.workflow import connect_if_thinking, evaluate_checkpoint, train_run

ENVS = 8
FRAME = encode_frame(np.zeros((16, 16, 3), np.uint8), "raw")


@pytest.fixture
def env(smoke: TrainConfig, homes: Homes) -> Iterator[ObjectNavVectorEnv]:
    task = smoke.env.model_copy(update={"width": 16, "height": 16, "think_action": True})
    made = ObjectNavVectorEnv(homes.scenes, homes.train, ENVS, task, seed=1)
    made.reset()
    yield made
    made.close()


def asked(env: ObjectNavVectorEnv, config: PrivilegedConfig, rounds: int, walks: bool = True) -> list[tuple[int, int]]:
    """(the way, what the planner said) of each env in each round; between rounds they walk about, if at all."""
    asking = PrivilegedPlanner(config).asking(env)
    follower = ShortestPathFollower(env)
    rng = np.random.default_rng(0)
    pairs = []
    for number in range(rounds):
        first = number * ENVS
        asking.ask({i: SubgoalRequest(request_id=str(first + i), goal="chair", frame=FRAME) for i in range(ENVS)})
        way = follower.actions().tolist()
        for i, reply in asking.replies(must_wait=True).items():
            assert isinstance(reply, SubgoalReply)
            direction = subgoal_direction(reply.subgoal)
            assert direction is not None
            pairs.append((way[i], int(direction)))
        if walks:
            env.step(np.where(rng.random(ENVS) < 0.5, way, rng.integers(1, 4, ENVS)))
    return pairs


def wrong(pairs: list[tuple[int, int]]) -> float:
    return sum(way != said for way, said in pairs) / len(pairs)


def test_without_errors_it_says_what_the_shortest_way_is(env: ObjectNavVectorEnv) -> None:
    pairs = asked(env, PrivilegedConfig(), 40)
    assert wrong(pairs) == 0
    assert {way for way, _ in pairs} == {Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT}


@pytest.mark.parametrize("errors_repeat", [False, True])
def test_it_is_wrong_as_often_as_it_says(env: ObjectNavVectorEnv, errors_repeat: bool) -> None:
    """One redrawn answer of four is right by chance."""
    pairs = asked(env, PrivilegedConfig(error=0.3, errors_repeat=errors_repeat), 250)
    assert wrong(pairs) == pytest.approx(0.3 * 0.75, abs=0.03)


def test_errors_repeat_in_the_same_place_or_not(env: ObjectNavVectorEnv) -> None:
    for errors_repeat in (True, False):
        pairs = asked(env, PrivilegedConfig(error=0.9, errors_repeat=errors_repeat), 30, walks=False)
        said = [{pair[1] for pair in pairs[i::ENVS]} for i in range(ENVS)]
        assert (max(map(len, said)) == 1) == errors_repeat


def test_it_can_keep_from_saying_stop(env: ObjectNavVectorEnv) -> None:
    for error in (0.0, 0.5):
        pairs = asked(env, PrivilegedConfig(error=error, says_stop=False), 40)
        assert Action.STOP not in {said for _, said in pairs}
        assert Action.STOP in {way for way, _ in pairs}
        if not error:
            assert {said for way, said in pairs if way == Action.STOP} == {Action.MOVE_FORWARD}


def test_shuffled_answers_say_nothing_of_the_way(env: ObjectNavVectorEnv) -> None:
    """They agree with it as often as two independent draws with their frequencies would."""
    pairs = asked(env, PrivilegedConfig(shuffled=True), 250)
    ways, said = Counter(way for way, _ in pairs), Counter(said for _, said in pairs)
    by_chance = sum(ways[action] * said[action] for action in ways) / len(pairs) ** 2
    assert 1 - wrong(pairs) == pytest.approx(by_chance, abs=0.03)
    # They are real answers all the same.
    assert {action: said[action] / len(pairs) for action in said} == pytest.approx(
        {action: ways[action] / len(pairs) for action in ways}, abs=0.03
    )


def obeyed(smoke: TrainConfig, homes: Homes, config: PrivilegedConfig) -> list[EpisodeRecord]:
    conditions = Conditions(smoke.env.model_copy(update={"max_steps": 300}), smoke.think, num_envs=4)
    planner = PrivilegedPlanner(config, seed=1)
    return play(
        lambda env, _: ThinkAndObey(env.num_envs),
        conditions,
        homes.scenes,
        homes.train[:16],
        planner,
        Interruption(),
    )


def test_who_obeys_it_arrives_and_who_obeys_another_ones_planner_does_not(smoke: TrainConfig, homes: Homes) -> None:
    led = obeyed(smoke, homes, PrivilegedConfig())
    assert np.mean([record.measures["success"] for record in led]) == 1
    assert np.mean([record.measures["spl"] for record in led]) > 0.9
    misled = obeyed(smoke, homes, PrivilegedConfig(shuffled=True))
    assert np.mean([record.measures["success"] for record in misled]) < 0.3


def test_a_run_with_it_is_repeatable_and_says_so(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    """Its answers are there at once, so that whoever does not wait for them does the same."""
    overrides = ["planner=privileged", "planner.privileged.error=0.3", "total_steps=128"]
    config = change_config(smoke, overrides=overrides)
    fast = change_config(config, overrides=["deterministic=false"])
    path = train_run(tmp_path / "lock-step", config, Interruption(), homes=homes)
    train_run(tmp_path / "fast", fast, Interruption(), homes=homes)
    train_run(tmp_path / "replayed", config, Interruption(), homes=homes, replay=tmp_path / "lock-step")
    for log in ("metrics", "thoughts"):
        first, *others = ((tmp_path / name / f"{log}.jsonl").read_text() for name in ("lock-step", "fast", "replayed"))
        assert first
        assert others == [first, first]
    folder, _ = evaluate_checkpoint(path, "held_out", Interruption(), homes=homes)
    protocol = json.loads((folder / "result.json").read_text())["protocol"]
    assert protocol["privileged"]
    assert protocol["planner"] == "privileged@shortest-path.error-0.3"
    assert protocol["config"]["planner"]["privileged"]["error"] == 0.3
    told, _ = evaluate_agent("planner", HomeSet("val", 0, 1), 2, Setting(smoke), PrivilegedPlanner())
    assert (told["privileged"], told["planner"]) == (True, "privileged@shortest-path")


def test_what_it_cannot_do_is_refused(smoke: TrainConfig, homes: Homes) -> None:
    once = change_config(smoke, overrides=["planner=privileged", "think.strategy=once"])
    with ExitStack() as stack, pytest.raises(ConfigError, match="makes no plans"):
        connect_if_thinking(once, stack)
    [answer] = PrivilegedPlanner().ask([SubgoalRequest(request_id="1", goal="chair", frame=FRAME)])
    assert isinstance(answer, PlannerFailed)
    alone = ObjectNavVectorEnv(homes.scenes, homes.train, 1, smoke.task)
    with pytest.raises(ConfigError, match="needs two envs"):
        PrivilegedPlanner(PrivilegedConfig(shuffled=True)).asking(alone)
    alone.close()
