"""Named agents in whole episodes of real homes."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import SubgoalReply, SubgoalRequest
from thinknav_sim.observations import Observations
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_trainer.agents import AGENTS, Agent, Obedience
from thinknav_trainer.config import ConfigError, ControlName, TrainConfig, change_config
from thinknav_trainer.evaluate import Conditions, EpisodeRecord, play
from thinknav_trainer.evaluate_agent import Setting, evaluate_agent, named_agent
from thinknav_trainer.home_sets import HomeSet, make_home_set, parse_home_set
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import FunctionTransport, MockTransport, PlannerClient, mock_info, reply_to
from thinknav_trainer.planner.privileged import PrivilegedPlanner
from thinknav_trainer.scenes import Homes
from thinknav_trainer.thinking import ThinkingEnv
from thinknav_trainer.thoughts import Thought


def played(
    agent: str, smoke: TrainConfig, homes: Homes, planner: PlannerClient | None = None, episodes: int = 12
) -> list[EpisodeRecord]:
    env = smoke.env.model_copy(update={"max_steps": 200})
    think = smoke.think.model_copy(update={"strategy": "agent" if planner else "never"})
    conditions = Conditions(env, think, num_envs=4, seed=0)
    return play(AGENTS[agent].make, conditions, homes.scenes, homes.train[:episodes], planner, Interruption())


def success(records: list[EpisodeRecord]) -> float:
    return sum(record.measures["success"] for record in records) / len(records)


def test_who_knows_the_way_finds_everything(smoke: TrainConfig, homes: Homes) -> None:
    records = played("shortest-path", smoke, homes)
    assert [record.episode_id for record in records] == [episode.episode_id for episode in homes.train[:12]]
    assert success(records) == 1
    assert all(record.measures["spl"] > 0.7 for record in records)


def test_a_perfect_stop_never_stops_in_vain(smoke: TrainConfig, homes: Homes) -> None:
    found = []
    for agent in ("random-perfect-stop", "bump-walker-perfect-stop"):
        records = played(agent, smoke, homes)
        assert all(record.measures["success"] != record.measures["timed_out"] for record in records)
        found.append(success(records))
    assert 0 < found[1] < 1


def test_who_never_stops_never_finds(smoke: TrainConfig, homes: Homes) -> None:
    assert all(record.measures["timed_out"] for record in played("bump-walker", smoke, homes))


def test_the_same_again(smoke: TrainConfig, homes: Homes) -> None:
    for agent in ("random", "bump-walker-perfect-stop"):
        assert played(agent, smoke, homes) == played(agent, smoke, homes)


def test_the_planner_only_agent_thinks_and_its_seconds_count(smoke: TrainConfig, homes: Homes) -> None:
    with PlannerClient(MockTransport(lambda request: "turn left", latency=0.01, sleep=lambda _: None)) as planner:
        records = played("planner", smoke, homes, planner, episodes=4)
    for record in records:
        thinks = len(record.thoughts)
        assert record.measures["thinks"] == thinks
        assert record.measures["think_rate"] == thinks / record.measures["steps"]
        assert 0.2 < record.measures["think_rate"] <= 0.25  # three turns for a word; a step once it has turned around
        assert record.measures["planner_seconds"] == pytest.approx(0.01 * thinks)


def test_a_planner_that_says_stop_ends_every_episode_on_the_fourth_step(smoke: TrainConfig, homes: Homes) -> None:
    with PlannerClient(MockTransport(lambda request: "stop")) as planner:
        records = played("planner", smoke, homes, planner)
    assert [record.measures["steps"] for record in records] == [4] * 12  # think, turn, think, stop
    assert [[subgoal for _, subgoal in record.thoughts] for record in records] == [["stop", "stop"]] * 12


def test_a_planner_of_our_own_process_is_asked_in_batches(smoke: TrainConfig) -> None:
    sizes: set[int] = set()

    def answer(requests: Sequence[SubgoalRequest]) -> list[SubgoalReply]:
        sizes.add(len(requests))
        return [reply_to(request, "move forward") for request in requests]

    transport = FunctionTransport(mock_info(), answer, shipped_text_encoder().encode)
    with PlannerClient(transport) as planner:
        protocol, records = evaluate_agent("planner", HomeSet("val", 0, 1), 4, Setting(smoke), planner)
    assert max(sizes) == 4
    assert len(records) == protocol["episodes"] == 4
    assert protocol["planner"] == "mock@0"
    assert protocol["split"] == "val:0-1"
    assert protocol["obedience"] == {"turns": 3, "forwards": 2, "stop_gate": 0.8, "looks": 2}


def test_a_farmer_earns_more_than_who_finds_by_the_papers_bonus_alone(smoke: TrainConfig) -> None:
    """As docs/thinking.md has it, with a planner that is always right."""
    earned: dict[str, dict[str, float]] = {}
    for name in ("farmer", "planner"):
        config = change_config(smoke, overrides=["think.reward=paper", "env.max_steps=500"])
        with PrivilegedPlanner(config.planner.privileged, 0) as planner:
            setting = Setting(config, Obedience(turns=1, forwards=1, looks=1))
            protocol, records = evaluate_agent(name, HomeSet("val", 0, 1), 4, setting, planner)
        assert protocol["privileged"]
        assert (protocol["obedience"] is None) == (name == "farmer")
        assert success(records) == (name == "planner")
        loops = sum(record.measures["think_loops"] for record in records) / len(records)
        assert loops > 0.95 if name == "farmer" else loops < 0.05
        bonus = sum(record.terms["agreement"] for record in records)
        total = sum(sum(record.terms.values()) for record in records)
        earned[name] = {"with": total, "without": total - bonus}
    assert earned["farmer"]["with"] > earned["planner"]["with"]
    assert earned["planner"]["without"] > 0 > earned["farmer"]["without"]


def test_no_reply_is_withheld_where_nothing_is_learnt(smoke: TrainConfig, homes: Homes) -> None:
    """`think.dropout` is of a run that learns."""
    told: list[bool] = []

    class Thinker:
        def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:
            told.extend(bool(observations["thought"][thought.env].any()) for thought in thoughts)
            return np.full(len(observations["gps"]), Action.THINK)

        def ended(self, done: NDArray[np.bool_]) -> None:
            """Nothing to forget."""

    think = smoke.think.model_copy(update={"dropout": 0.9})
    conditions = Conditions(smoke.env, think, num_envs=2)
    with PlannerClient(MockTransport(lambda request: "turn left")) as planner:
        play(lambda env, seed: Thinker(), conditions, homes.scenes, homes.train[:2], planner, Interruption())
    assert told == [True] * 2 * (smoke.env.max_steps - 1)


@pytest.mark.parametrize("control", ["none", "zeros", "another"])
def test_who_is_through_asks_nobody_unless_others_are_told_what_it_hears(
    smoke: TrainConfig, homes: Homes, control: ControlName
) -> None:
    """The envs' shares end at different times: some find what they look for, and one has an episode more."""
    env = smoke.env.model_copy(update={"max_steps": 120})
    think = smoke.think.model_copy(update={"strategy": "agent"})
    conditions = Conditions(env, think, num_envs=4, seed=0, control=control)
    with PrivilegedPlanner(smoke.planner.privileged, 0) as planner:
        asked: list[int] = []

        def make(thinking: ThinkingEnv, seed: int) -> Agent:
            ask = thinking.think

            def counted(envs: NDArray[np.integer[Any]]) -> None:
                asked.extend(envs.tolist())
                ask(envs)

            thinking.think = counted  # type: ignore[method-assign]
            return AGENTS["planner"].make(thinking, seed)

        records = play(make, conditions, homes.scenes, homes.train[:9], planner, Interruption())
    assert [record.episode_id for record in records] == [episode.episode_id for episode in homes.train[:9]]
    thinks = sum(record.measures["thinks"] for record in records)
    assert len(asked) > thinks if control == "another" else len(asked) == thinks
    assert all(len(record.path) == len(record.actions) == record.measures["steps"] for record in records)


def test_agents_that_are_not_there_or_lack_a_planner_are_refused(smoke: TrainConfig) -> None:
    with pytest.raises(ConfigError, match="there is no agent 'walker'; there are planner, random"):
        named_agent("walker")
    with pytest.raises(ConfigError, match="agent 'planner' thinks, and needs a planner"):
        evaluate_agent("planner", HomeSet("val", 0, 1), 1, Setting(smoke))


# Homes


def test_home_sets_are_read_as_they_are_written() -> None:
    assert parse_home_set("val:0-20") == HomeSet("val", 0, 20)
    assert str(HomeSet("train", 3, 5)) == "train:3-5"
    assert len(parse_home_set("planner:10-12")) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("val", "homes are named SPLIT:FIRST-END, such as val:0-20"),
        ("test:0-2", "with a split of train, planner, val"),
        ("val:3-3", "names no homes"),
        ("val:0-1000001", "END at most 1000000"),
    ],
)
def test_home_sets_that_are_none_are_refused(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(words)):
        parse_home_set(text)


def test_categories_and_homes_come_equally_often(smoke: TrainConfig) -> None:
    scenes, episodes = make_home_set(HomeSet("val", 0, 4), 26, smoke.env)
    names = [episode.scene_name for episode in episodes]
    assert [names.count(scene.name) for scene in scenes] == [6, 7, 6, 7]
    categories = [episode.object_category for episode in episodes]
    counts = [categories.count(category) for category in GOAL_CATEGORIES]
    assert max(counts) - min(counts) <= 2
    assert len({episode.episode_id for episode in episodes}) == 26
    with pytest.raises(ConfigError, match="3 episodes are too few for 4 homes"):
        make_home_set(HomeSet("val", 0, 4), 3, smoke.env)
